#!/usr/bin/env bash
# Processes a drive on Slurm, as printed by chainage slurm.
#
#     bash THIS-SCRIPT     opens the run and submits the first jobs
#
# For each pass there is a job array, whose tasks compute its units, and a job behind it (afterok) that completes the pass and
# submits the next ones. A unit that fails is tried three times. If an array fails, the job behind it is cancelled; start the
# script again, and it resumes: finished units are kept. The script must stay where it is until the run is finished.
set -euo pipefail

program=@PROGRAM@
out=@OUT@
array=@ARRAY@
options=(@SBATCH@)
plan=(@PLAN@)

value() { # KEY: of the JSON in $due
    sed -n "s/^  \"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}$/\1/p" <<<"$due"
}

submit() {
    local pass of chunk tasks before
    pass=$(value pass)
    of=$(value of)
    if [ "$pass" = null ]; then
        echo "finished: $out"
        return
    fi
    if [ "$of" = 0 ]; then
        sbatch --parsable --requeue --job-name="chainage-reduce" --output="$out/slurm.log" --open-mode=append \
            "${options[@]}" "$self" reduce "$self" "$pass" >/dev/null
        echo "pass $pass: no units"
        return
    fi
    chunk=$(((of + array - 1) / array))
    tasks=$(((of + chunk - 1) / chunk))
    before=$(sbatch --parsable --requeue --job-name="chainage-$pass" --array="0-$((tasks - 1))" --output=/dev/null \
        "${options[@]}" "$self" units "$self" "$pass" "$chunk" "$of")
    sbatch --parsable --requeue --job-name="chainage-reduce" --dependency="afterok:${before%%;*}" --kill-on-invalid-dep=yes \
        --output="$out/slurm.log" --open-mode=append "${options[@]}" "$self" reduce "$self" "$pass" >/dev/null
    echo "pass $pass: $of units in $tasks tasks, job ${before%%;*}"
}

case ${1:-open} in
open)
    self=$(readlink -f "$0")
    mkdir -p "$out"
    # Settings may name files relative to the folder in which this script was made.
    cd @FOLDER@
    due=$("$program" plan "${plan[@]}" -o "$out" --units --leave-survey --json)
    submit
    ;;
units) # SELF PASS CHUNK OF
    first=$((SLURM_ARRAY_TASK_ID * $4))
    end=$((first + $4 < $5 ? first + $4 : $5))
    for try in 1 2 3; do
        code=0
        "$program" work "$out" --pass "$3" --units "$first..$end" --threads "${SLURM_CPUS_PER_TASK:-1}" \
            2>"$out/slurm-$3-$SLURM_ARRAY_TASK_ID.err" || code=$?
        [ $code -ne 0 ] || break
    done
    [ $code -ne 0 ] || rm -f "$out/slurm-$3-$SLURM_ARRAY_TASK_ID.err"
    exit $code
    ;;
reduce) # SELF PASS
    self=$2
    due=$("$program" reduce "$out" --after "$3" --json)
    submit
    ;;
esac
