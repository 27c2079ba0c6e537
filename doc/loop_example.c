/* A loop in C: the run of an input file, and the force of the grains on one of its boundaries at the end. loop.md says how it is built. */
#include <gravier.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

/* Say what the last call has refused, before the next call forgets it. */
static int said(int status)
{
    if (gravier_error()[0] != '\0')
        fprintf(stderr, "loop: error: %s\n", gravier_error());
    return status;
}

static int end(int status)
{
    gravier_finalize();
    return status;
}

/* Make all steps and read the force on a boundary; the status of the first call that fails, or 0. */
static int play(gravier_simulation *s, const char *name, double force[3], int64_t *made)
{
    int64_t goes_on;
    int wall, n, status = gravier_boundary(s, name, &wall);

    while (status == 0 && (status = gravier_whole(s, "goes_on", &goes_on)) == 0 && goes_on)
        status = gravier_step(s);
    if (status == 0)
        status = gravier_get_boundary(s, wall, "force", force, &n);
    if (status == 0)
        status = gravier_whole(s, "step", made);
    return said(status);
}

int main(int count, char **words)
{
    gravier_simulation *s;
    int64_t made = 0, rank = 0;
    double force[3] = {0.0, 0.0, 0.0};
    int status, closed;

    if (count != 3) {
        fprintf(stderr, "usage: loop CASE.nml BOUNDARY\n");
        return 2;
    }
    status = gravier_open(words[1], "loop", 0, NULL, &s);
    if (status != 0)
        return end(said(status));
    gravier_whole(s, "rank", &rank);
    status = play(s, words[2], force, &made);
    closed = said(gravier_close(s));
    if (status == 0 && rank == 0)
        printf("%d steps, the grains press %s with %.3f N\n", (int)made, words[2],
               sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2]));
    return end(status != 0 ? status : closed);
}
