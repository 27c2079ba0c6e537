#!/bin/sh
# A case, or the rows of a list one after the other, on this machine without a scheduler. It goes on by itself from the last checkpoint
# each SECONDS_EACH (an hour), so that a machine that goes down loses no more.
#   CASE=case.nml RANKS=4 sh mpirun.sh
set -u
CASE=${CASE:-case.nml}
LIST=${LIST:-}
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
exec gravier_job --ranks "${RANKS:-1}" --seconds "${SECONDS_EACH:-3600}" ${LIST:+--list "$LIST"} "$CASE"
