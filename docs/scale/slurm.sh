#!/bin/bash
# One shard of a plan for each task of the array, merged when all are done:
#   matchbench plan DATASET --matchers sift --shards 16 --out PLAN
#   job=$(sbatch --parsable --array=1-16 slurm.sh PLAN)
#   sbatch --dependency=afterok:$job --wrap "matchbench merge PLAN --out RUN"
# A task that was killed or preempted is queued again and goes on where it was.
#SBATCH --job-name=matchbench
#SBATCH --cpus-per-task=8
#SBATCH --mem=4G
#SBATCH --time=12:00:00
#SBATCH --requeue
#SBATCH --output=%x-%A-%a.log
set -euo pipefail
plan=${1:?the folder of a plan}
# 2: some pairs failed. They count as wrong, and stop no merge.
matchbench work "$plan" --shard "$SLURM_ARRAY_TASK_ID" --threads "${SLURM_CPUS_PER_TASK:-1}" || [ $? -eq 2 ]
