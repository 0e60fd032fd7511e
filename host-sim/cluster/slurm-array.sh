#!/usr/bin/env bash
# Makes the parts of a table or a workspace as an array of Slurm jobs, then merges them in a job that waits for
# all of them.
#
#   slurm-array.sh --shards 64 --out crane.cdpr [--parts FOLDER] [--sbatch OPTION]... -- cdpr table build ...
#   slurm-array.sh --shards 64 --out ws --sbatch --time=4:00:00 --sbatch --cpus-per-task=16 -- cdpr workspace ...
#
# The command after -- is run for each part with --shard K/N --out PLACE added (and --threads, from
# --cpus-per-task, where it gives none); the command that merges follows from it. --sbatch, any number of times,
# hands an option to sbatch, for the array and for the merge.
#
# Parts lie in FOLDER (default OUT.parts), which all nodes must see under the same path, as they must the program
# and the folder this is started in. A part that is killed, preempted or out of time goes on where it was: Slurm
# requeues it after a failed node, and the same command, given again, goes on with what is missing. While a process
# makes a part it holds a lock on it; another one waits (exit code 75 of cdpr), so that two never write one part.
# That needs a file system whose locks (flock) reach over all nodes, as those of NFS do.
#
# Exit code: 0 submitted, with the numbers of both jobs on stdout; 2 bad arguments; else that of sbatch.
set -euo pipefail

BUSY=75 # what cdpr says when another process is making the part

die() { printf 'slurm-array.sh: %s\n' "$*" >&2; exit 2; }

# Sets `program` to the words before "workspace" or "table build", `kind` and `arguments` to those after.
split_command() {
    program=() arguments=() kind=
    local words=("$@") i
    for ((i = 1; i < ${#words[@]}; i++)); do
        if [ "${words[i]}" = workspace ]; then
            kind=workspace program=("${words[@]:0:i}") arguments=("${words[@]:i+1}")
            break
        elif [ "${words[i]}" = table ] && [ "${words[i + 1]:-}" = build ]; then
            kind=table program=("${words[@]:0:i}") arguments=("${words[@]:i+2}")
            break
        fi
    done
    [ -n "$kind" ] || die "the command after -- is neither 'cdpr table build ...' nor 'cdpr workspace ...'"
    [ "${arguments[0]:-}" != merge ] || die "the command after -- must make a workspace, not merge one"
    local word
    for word in "${arguments[@]}"; do
        case "$word" in
            --shard | --shard=* | --out | --out=*) die "${word%%=*} is set here, not in the command after --" ;;
        esac
    done
}

# In the array: one part. slurm-array.sh part SHARDS FOLDER COMMAND...
make_part() {
    local shards=$1 folder=$2 k=${SLURM_ARRAY_TASK_ID:?only Slurm starts this}
    shift 2
    split_command "$@"
    local command=("${program[@]}") place=$folder word has_threads=
    if [ "$kind" = table ]; then
        command+=(table build)
        place=$folder/part-$k-of-$shards.jsonl
    else
        command+=(workspace)
    fi
    for word in "${arguments[@]}"; do
        case "$word" in --threads | --threads=*) has_threads=1 ;; esac
    done
    if [ -z "$has_threads" ] && [ -n "${SLURM_CPUS_PER_TASK:-}" ]; then
        arguments+=(--threads "$SLURM_CPUS_PER_TASK")
    fi
    command+=("${arguments[@]}" --shard "$k/$shards" --out "$place")
    local code=0
    while "${command[@]}" || code=$?; [ "$code" -eq "$BUSY" ]; do
        code=0
        sleep 10
    done
    return "$code"
}

# After the array. slurm-array.sh merge SHARDS FOLDER OUT COMMAND...
merge_parts() {
    local shards=$1 folder=$2 out=$3 k parts=()
    shift 3
    split_command "$@"
    for ((k = 1; k <= shards; k++)); do
        parts+=("$folder/part-$k-of-$shards.jsonl")
    done
    "${program[@]}" "$kind" merge --out "$out" "${parts[@]}"
}

submit() {
    local shards='' out='' folder='' options=()
    while [ $# -gt 0 ]; do
        case "$1" in
            -h | --help)
                sed -n '2,/^set /s/^# \{0,1\}//p' "$0"
                exit 0
                ;;
            --)
                shift
                break
                ;;
            --shards | --out | --parts | --sbatch)
                [ $# -gt 1 ] || die "$1: its value is missing"
                case "$1" in
                    --shards) shards=$2 ;;
                    --out) out=$2 ;;
                    --parts) folder=$2 ;;
                    --sbatch) options+=("$2") ;;
                esac
                shift 2
                ;;
            *) die "$1: no such option; see --help" ;;
        esac
    done
    [[ "$shards" =~ ^[1-9][0-9]*$ ]] || die "--shards: the number of parts is missing"
    [ -n "$out" ] || die "--out is missing"
    [ $# -gt 0 ] || die "the command is missing: -- cdpr table build ..., or -- cdpr workspace ..."
    split_command "$@"
    folder=${folder:-$out.parts}
    mkdir -p -- "$folder"
    # Without a path the jobs would look for a copy of this script that Slurm made.
    local self array merge
    self=$(realpath -- "$0")
    array=$(sbatch --parsable --requeue --job-name=cdpr-parts --array="1-$shards" "${options[@]}" \
        "$self" part "$shards" "$folder" "$@")
    array=${array%%;*} # the number of the job, without that of the cluster
    printf 'parts: job %s\n' "$array"
    merge=$(sbatch --parsable --job-name=cdpr-merge --dependency="afterok:$array" --kill-on-invalid-dep=yes \
        "${options[@]}" "$self" merge "$shards" "$folder" "$out" "$@")
    printf 'merge: job %s\n' "${merge%%;*}"
}

case "${1:-}" in
    part)
        shift
        make_part "$@"
        ;;
    merge)
        shift
        merge_parts "$@"
        ;;
    *) submit "$@" ;;
esac
