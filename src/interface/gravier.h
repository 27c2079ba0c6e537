/* The loop of a run in the hands of a C or C++ program: link with libgravier. doc/loop.md describes it, in Python.
 *
 * Functions that return int return 0, or the exit status of an error: 2 bad input or a wrong call, 4 anything else. gravier_error()
 * then has its line. A simulation that is NULL, or closed, is a wrong call. None ends the process, but for a system that gives no
 * memory. "Collective": all ranks call together.
 */
#ifndef GRAVIER_H
#define GRAVIER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gravier_simulation gravier_simulation;

/* options of gravier_open, to be added: go on from the checkpoint of the case, if there is one; the log goes to run.log alone; bodies have
 * forces that the loop applies; a restart takes loads, drives and coefficients of contact that the case has changed */
enum { GRAVIER_RESTART = 1, GRAVIER_QUIET = 2, GRAVIER_FORCES = 4, GRAVIER_CHANGED = 8 };

/* Open the run of an input file. `command` says in results.h5 who runs it. `communicator` points to the handle that MPI_Comm_c2f gives, or
 * is NULL for all ranks. MPI is started unless it runs. One run at a time is open in a process. Collective. */
int gravier_open(const char *path, const char *command, int options, const int *communicator, gravier_simulation **simulation);

/* Make one step; end the run after the present step, for a reason that the log tells; write a checkpoint. Collective. */
int gravier_step(gravier_simulation *simulation);
int gravier_stop(gravier_simulation *simulation, const char *reason);
int gravier_checkpoint(gravier_simulation *simulation);

/* End the run, which is stopped if it goes on, and give back what it holds. Returns what the program exits with: 0; 3 where a solve missed
 * its tolerance; 4 where the run was interrupted by SIGTERM or by its walltime; or the status of an error. Collective. */
int gravier_close(gravier_simulation *simulation);

/* End MPI, if gravier_open has started it: to be called before the process ends. Collective. */
void gravier_finalize(void);

/* End the processes of all ranks with status 4, where this one cannot go on and the others would wait for it. Not collective. */
void gravier_abort(void);

/* The line of the last error, empty after a success; valid until the next call. */
const char *gravier_error(void);

/* Numbers by name. Whole: goes_on, step, steps, dimension, velocity_entries, subdomains (of this rank), boundaries, rank, ranks, restarted,
 * bodies; of the last step contacts, iterations, converged, left, entered.
 * Real: time, time_step, theta, gravity_x, gravity_y, gravity_z, friction; of the last step kinetic_energy, max_overlap, residual,
 * velocity_error, and what options of &output add to history.csv, such as stress_xx. */
int gravier_whole(gravier_simulation *simulation, const char *name, int64_t *value);
int gravier_real(gravier_simulation *simulation, const char *name, double *value);

/* kinds of the numbers of an array */
enum { GRAVIER_DOUBLE = 0, GRAVIER_INT64 = 1, GRAVIER_INT32 = 2 };

/* A field of the bodies of a subdomain of this rank (from 0), where it is stored: read it until the next step. shape: bodies, entries of
 * each. Doubles: position, velocity (with the spin behind where bodies turn), force, radius, mass, inertia, orientation; int64_t: id;
 * int: material, glued (the number of the boundary, or 0). */
int gravier_array(gravier_simulation *simulation, const char *name, int subdomain, const void **address, int64_t shape[2], int *kind);

/* Set velocity, or force with GRAVIER_FORCES, of all bodies of a subdomain of this rank, in the order and the shape of gravier_array.
 * Each rank sets what it wants to. gravier_check_array tells whether gravier_set_array takes the values, and sets nothing. */
int gravier_check_array(gravier_simulation *simulation, const char *name, int subdomain, const double *values, const int64_t shape[2]);
int gravier_set_array(gravier_simulation *simulation, const char *name, int subdomain, const double *values, const int64_t shape[2]);

/* What follows is set with the same values on all ranks, holds from the next step on, and is not in checkpoints. */
int gravier_set_gravity(gravier_simulation *simulation, const double *values, int n);
int gravier_set_friction(gravier_simulation *simulation, double value);

/* The periodic cell, where it moves or is sheared. To read: length_x, tilt_xy, strain_rate_x, shear_rate_xy, pressure_x, shear_stress_xy and
 * the like; what is held is 0 where a rate moves a component. To set: rates, and stresses of components that stresses drive in the case. */
int gravier_get_cell(gravier_simulation *simulation, const char *name, double *value);
int gravier_set_cell(gravier_simulation *simulation, const char *name, double value);

/* Boundaries, from 0; NULL for a name is an error. To read: position, normal, velocity (of its pivot, else of its position), spin, force (of
 * the grains on it, in the last step), applied_force, pressure, friction. To set: velocity, spin, applied_force, pressure, friction. */
int gravier_boundary(gravier_simulation *simulation, const char *name, int *number);
const char *gravier_boundary_name(gravier_simulation *simulation, int number);
int gravier_get_boundary(gravier_simulation *simulation, int number, const char *name, double values[3], int *n);
int gravier_set_boundary(gravier_simulation *simulation, int number, const char *name, const double *values, int n);

/* Disks or spheres that enter at the start of the next step, with the next identifiers; a mass of 0 is that of the density of the material.
 * Free bodies that leave at the start of the next step. Collective. */
int gravier_add_bodies(gravier_simulation *simulation, int n, const double *radius, const double *mass, const int *material,
                       const double *position, const double *velocity);
int gravier_remove_bodies(gravier_simulation *simulation, int n, const int64_t *id);

/* Over the ranks, in place: sums, which do not depend on the order of the ranks; the highest values. Collective. */
void gravier_sum(gravier_simulation *simulation, int n, double *values);
void gravier_highest(gravier_simulation *simulation, int n, double *values);

#ifdef __cplusplus
}
#endif

#endif
