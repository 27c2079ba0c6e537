#!/bin/sh
# A case under PBS, submitted once more until it is done. Copy this file beside the case and change what is marked.
#   qsub pbs.sh                       one case
#   qsub -J 1-8 pbs.sh               rows 1 to 8 of a list (-t with Torque)
#PBS -N gravier
#PBS -l select=1:ncpus=8:mpiprocs=8
#PBS -l walltime=04:00:00
#PBS -j oe
# what a site asks for (marked): queue, project, modules
#   #PBS -q ...
#   module load gcc openmpi hdf5-parallel mumps metis
set -u
CASE=${CASE:-case.nml}           # changed: the case, or the template of a list
LIST=${LIST:-}                   # changed: the list of an array of jobs
SCRIPT=${SCRIPT:-pbs.sh}         # changed: this file
PBS_WALLTIME=${PBS_WALLTIME:-14400}   # changed: the walltime above [s]; Torque sets it by itself
export CASE LIST SCRIPT PBS_WALLTIME OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
cd "${PBS_O_WORKDIR:-.}" || exit 2
row=${GRAVIER_ROW:-${PBS_ARRAY_INDEX:-${PBS_ARRAYID:-}}}
unset PBS_ARRAY_INDEX PBS_ARRAYID
export GRAVIER_RESUBMIT="qsub -W depend=afterany:$PBS_JOBID -v CASE,LIST,SCRIPT,PBS_WALLTIME,GRAVIER_ROW \"$SCRIPT\""
exec gravier_job ${LIST:+--list "$LIST" --row "$row"} "$CASE"
