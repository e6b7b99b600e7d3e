#!/usr/bin/env bash
# A job by Slurm on this host, one controller and two nodes of one processor, of which a tenth of the tasks is killed: the picture is that of one process. See
# common.sh. It needs root, and the packages slurm-wlm and munge. The daemons are its own, with their files in its folder.
. "$(dirname "$0")/common.sh"
for program in slurmctld slurmd sbatch munged; do
    command -v $program >/dev/null || { echo "slurm.sh: $program is missing; run: sudo apt-get install slurm-wlm munge" >&2; exit 1; }
done
[ "$(id -u)" = 0 ] || { echo "slurm.sh: it needs root, as slurmd does" >&2; exit 1; }
chmod 755 "$work"
clean() {
    [ ${#daemons[@]} = 0 ] || kill "${daemons[@]}" 2>/dev/null || true
    wait
    rm -rf "$work"
}

# Starts a daemon, in this shell's charge.
start() {
    "$@" >>"$work/${1##*/}.log" 2>&1 &
    daemons+=($!)
}

mkdir -p munge state spool
dd if=/dev/urandom of=munge/key bs=1024 count=1 status=none
chmod 700 munge && chmod 400 munge/key
start munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge.socket" --pid-file="$work/munge/pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed"
base=${PORT:-16817}
# Tasks that are queued again begin once the old credentials are over: 5 s, in place of 2 minutes.
cat >slurm.conf <<END
ClusterName=farm
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$base
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool/%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
MailProg=/bin/true
ReturnToService=2
JobRequeue=1
MaxJobCount=20000
NodeName=node1 NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=$((base + 1)) CPUs=1
NodeName=node2 NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=$((base + 2)) CPUs=1
PartitionName=farm Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
export SLURM_CONF=$work/slurm.conf
sleep 1
start slurmctld -D -f "$SLURM_CONF"
for node in node1 node2; do start slurmd -D -N $node -f "$SLURM_CONF"; done
for _ in $(seq 30); do
    [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 2 ] && break
    sleep 1
done
[ "$(sinfo -h -t idle -o %D)" = 2 ] || { tail -n 20 ./*.log munge/log >&2; exit 1; }

whole
job slurm >job.sh
export PATH="$work/bin:$PATH"
last=$(sh job.sh)
while [ -n "$(squeue -h -j "$last" 2>/dev/null)" ]; do sleep 1; done
ls out*.exr >/dev/null 2>&1 || { tail -n 20 ./*.farm/*.log slurmctld.log >&2; exit 1; }
check slurm
