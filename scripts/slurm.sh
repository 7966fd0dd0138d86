#!/usr/bin/env bash
# Runs a drive on a real Slurm of this host by the script of chainage slurm, and compares the bytes with one process. A
# nightly suite: it needs root, and the packages slurmctld, slurmd, slurm-client and munge of Debian.
#
#     scripts/slurm.sh [METHOD]...
#
# Starts munged, slurmctld and slurmd with files of their own, and stops them. One array task fails on purpose, to see that
# it is tried again. Needs a release build (or CHAINAGE). Exit code 1: an output differs, or a job failed.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(readlink -f "${CHAINAGE:-target/release/chainage}")
methods=("$@")
[ $# -gt 0 ] || methods=(euclidean street)
PATH=$PATH:/usr/sbin
for tool in munged slurmctld slurmd sbatch; do
    command -v "$tool" >/dev/null || {
        echo "skipped: $tool is not installed"
        exit 0
    }
done
[ "$(id -u)" = 0 ] || {
    echo "skipped: slurmd needs root"
    exit 0
}

scratch=$(mktemp -d "${TMPDIR:-/tmp}/slurm.XXXXXX")
chmod 755 "$scratch"
daemons=()
stop() {
    for daemon in "${daemons[@]}"; do kill "$daemon" 2>/dev/null || true; done
    wait 2>/dev/null || true
    rm -rf "$scratch"
}
trap stop EXIT

host=$(hostname -s)
cores=$(nproc)
mkdir -p "$scratch"/{state,spool}
(umask 077 && head -c 1024 /dev/urandom >"$scratch/munge.key")
cat >"$scratch/slurm.conf" <<CONF
ClusterName=chainage
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$scratch/munge.socket
CredType=cred/munge
SlurmctldPort=16817
SlurmdPort=16818
SlurmctldPidFile=$scratch/slurmctld.pid
SlurmdPidFile=$scratch/slurmd.pid
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1,sched_min_interval=100000,bf_interval=1,batch_sched_delay=0
ReturnToService=2
MpiDefault=none
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cores State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
echo "CgroupPlugin=cgroup/v1" >"$scratch/cgroup.conf"
export SLURM_CONF=$scratch/slurm.conf
munged --foreground --key-file "$scratch/munge.key" --socket "$scratch/munge.socket" --pid-file "$scratch/munged.pid" \
    --log-file "$scratch/munged.log" --seed-file "$scratch/munge.seed" --force >"$scratch/munged.out" 2>&1 &
daemons+=($!)
sleep 1
slurmctld -D >"$scratch/slurmctld.log" 2>&1 &
daemons+=($!)
slurmd -D >"$scratch/slurmd.log" 2>&1 &
daemons+=($!)
for _ in $(seq 60); do
    [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break
    sleep 0.5
done
[ "$(sinfo -h -o %T)" = idle ] || {
    echo "slurm.sh: FAILED, the node is not idle"
    tail -n 5 "$scratch"/*.log
    exit 1
}

# Fails once in an array task: the first call of work for unit 1 of the pass ground.
cat >"$scratch/chainage" <<WRAPPER
#!/bin/sh
case "\$*" in *"--pass ground --units 1.."*)
    if mkdir "$scratch/failed-\$(basename "\$2")" 2>/dev/null; then exit 8; fi ;;
esac
exec "$program" "\$@"
WRAPPER
chmod +x "$scratch/chainage"

cp tests/data/tree_road_sweep.laz "$scratch/drive.laz"
for method in "${methods[@]}"; do
    options=(--method "$method" --tile-length 10 --memory 512M)
    "$program" run "$scratch/drive.laz" -o "$scratch/alone-$method" "${options[@]}" --progress none >/dev/null
    "$program" slurm "$scratch/drive.laz" -o "$scratch/out-$method" --array-size 20 "${options[@]}" |
        sed "s|^program=.*|program=$scratch/chainage|" >"$scratch/$method.slurm"
    began=$SECONDS
    bash "$scratch/$method.slurm"
    while [ -n "$(squeue -h -o %i)" ] && [ $((SECONDS - began)) -lt 600 ]; do sleep 1; done
    if [ -n "$(squeue -h -o %i)" ] || ! "$program" next "$scratch/out-$method" --json | grep -q '"pass": null'; then
        echo "slurm.sh: FAILED, $method is not finished"
        squeue
        cat "$scratch/out-$method"/slurm*
        exit 1
    fi
    [ -d "$scratch/failed-out-$method" ] || {
        echo "slurm.sh: FAILED, no task had to be tried again"
        exit 1
    }
    for file in drive.laz objects.csv objects.geojson; do
        cmp "$scratch/alone-$method/$file" "$scratch/out-$method/$file"
    done
    echo "$method: $(grep -c '^pass' "$scratch/out-$method/slurm.log") passes by Slurm in $((SECONDS - began)) s, the bytes of one process"
done
echo "slurm.sh: passed"
