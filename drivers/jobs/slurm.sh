#!/bin/sh
# A case under Slurm, submitted once more until it is done. Copy this file beside the case and change what is marked.
#   sbatch slurm.sh                   one case
#   sbatch --array=1-8 slurm.sh      rows 1 to 8 of a list
#SBATCH --job-name=gravier
#SBATCH --ntasks=8
#SBATCH --time=04:00:00
#SBATCH --output=gravier-%j.log
# what a site asks for (marked): partition, account, modules
#   #SBATCH --partition=...
#   module load gcc openmpi hdf5-parallel mumps metis
set -u
CASE=${CASE:-case.nml}           # changed: the case, or the template of a list
LIST=${LIST:-}                   # changed: the list of an array of jobs
SCRIPT=${SCRIPT:-slurm.sh}       # changed: this file
export CASE LIST SCRIPT OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
cd "${SLURM_SUBMIT_DIR:-.}" || exit 2
export GRAVIER_RESUBMIT="sbatch --dependency=afterany:$SLURM_JOB_ID --export=ALL,GRAVIER_ROW \"$SCRIPT\""
row=${GRAVIER_ROW:-${SLURM_ARRAY_TASK_ID:-}}
unset SLURM_ARRAY_TASK_ID
exec gravier_job ${LIST:+--list "$LIST" --row "$row"} "$CASE"
