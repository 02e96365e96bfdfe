#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A Slurm of one machine with several nodes: it submits an array, kills tasks, lets Slurm requeue them, and compares
# the bytes with those of one process. As root, with Debian's packages:
#
#     apt-get install --no-install-recommends slurmctld slurmd slurm-client munge
#     bench/slurm_node.sh build/release/tangere [kills]
#
# It starts its own daemons with their files in a new folder, and ends them. A Slurm that runs here is left alone.
set -euo pipefail
program=$(realpath "${1:?expected the program tangere}")
kills=${2:-20}
for needed in slurmctld slurmd sbatch munged; do
  command -v "$needed" >/dev/null || { echo "no $needed here: apt-get install slurmctld slurmd slurm-client munge" >&2
    exit 3; }
done
[ "$(id -u)" -eq 0 ] || { echo "slurmd needs root" >&2; exit 3; }

folder=$(mktemp -d /tmp/tangere_slurm.XXXXXX)
chmod 755 "$folder"
nodes=4
pids=()
finish() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait || true
}
trap finish EXIT

# Munge with a key and a socket of its own.
mkdir -m 700 "$folder/munge"
mkdir -m 755 "$folder/socket"
dd if=/dev/urandom bs=128 count=1 of="$folder/munge/key" status=none
chmod 400 "$folder/munge/key"
munged --foreground --key-file "$folder/munge/key" --socket "$folder/socket/munge" --pid-file "$folder/munge/pid" \
  --seed-file "$folder/munge/seed" --log-file "$folder/munge/log" --force >/dev/null 2>&1 &
pids+=($!)

host=$(hostname -s)
cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=17817
SlurmctldPidFile=$folder/slurmctld.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdPidFile=$folder/slurmd.%n.pid
SlurmdLogFile=$folder/slurmd.%n.log
SlurmdSpoolDir=$folder/spool.%n
StateSaveLocation=$folder/state
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/socket/munge
CredType=cred/munge
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
JobRequeue=1
RequeueExit=75,137
SchedulerParameters=requeue_setup_env_fail,batch_sched_delay=0,sched_interval=2
MinJobAge=3600
NodeName=node[1-$nodes] NodeHostname=$host NodeAddr=127.0.0.1 Port=[17901-1790$nodes] CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:4
CONF
mkdir "$folder/state"
export SLURM_CONF=$folder/slurm.conf
sleep 1
slurmctld -D >/dev/null 2>&1 &
pids+=($!)
for ((i = 1; i <= nodes; ++i)); do
  mkdir "$folder/spool.node$i"
  slurmd -D -N "node$i" >/dev/null 2>&1 &
  pids+=($!)
done
for ((i = 0; i < 60; ++i)); do
  ready=$(sinfo -h -N -t idle -o %N 2>/dev/null | wc -l)
  [ "$ready" -eq "$nodes" ] && break
  sleep 1
done
sinfo -N || true
[ "$ready" -eq "$nodes" ] || { tail -n 5 "$folder"/*.log >&2; echo "the nodes are not ready" >&2; exit 1; }
echo "$(sinfo --version), $nodes nodes on this machine"

set_of=(generate box_pushing --episodes 4096 --shards 64 --seed 11 --threads 1 --quiet)
"$program" "${set_of[@]}" --output "$folder/alone"

cat >"$folder/job.sh" <<JOB
#!/bin/bash
#SBATCH --job-name=push
#SBATCH --array=0-15
#SBATCH --ntasks=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=$folder/%a.out
$program ${set_of[*]} --output $folder/set --resume
exit \$?
JOB
job=$(sbatch --parsable "$folder/job.sh")
cat >"$folder/srun.sh" <<JOB
#!/bin/bash
#SBATCH --job-name=beside
#SBATCH --nodes=2
#SBATCH --ntasks=4
#SBATCH --overcommit
#SBATCH --output=$folder/srun.out
srun $program ${set_of[*]} --output $folder/srun
JOB

# Slurm lets a requeued task wait for two minutes, so that its node has dropped it. Two seconds do here: tasks that
# wait in two rounds start.
waiting=""
release() {
  local now task
  now=$(squeue -h -r -j "$job" -t PD -o %i || true)
  for task in $now; do
    if grep -qx "$task" <<<"$waiting"; then scontrol update "jobid=$task" starttime=now >/dev/null 2>&1 || true; fi
  done
  waiting=$now
}
left() { squeue -h -r -j "$1" -o %i || echo unknown; }

# Kills: SIGKILL, which ends the script with 137, and SIGTERM, after which the program ends at a safe point with 75.
# Slurm requeues both.
killed=0
begin=$SECONDS
while [ "$killed" -lt "$kills" ] && [ -n "$(left "$job")" ]; do
  sleep "0.$((RANDOM % 9 + 1))"
  if [ $((SECONDS - begin)) -ge 3 ]; then begin=$SECONDS; release; fi
  mapfile -t running < <(pgrep -f "^$program generate .* --output $folder/set" || true)
  [ "${#running[@]}" -gt 0 ] || continue
  if ((killed % 2)); then signal=TERM; else signal=KILL; fi
  if kill -"$signal" "${running[RANDOM % ${#running[@]}]}" 2>/dev/null; then killed=$((killed + 1)); fi
done
echo "killed $killed processes of the array"
while [ -n "$(left "$job")" ]; do
  sleep 3
  release
done
same() {
  local number=0 name
  for path in "$folder"/alone/shard-*.h5; do
    name=$(basename "$path")
    cmp "$path" "$folder/$1/$name" || return 1
    number=$((number + 1))
  done
  cmp "$folder/alone/robomimic.hdf5" "$folder/$1/robomimic.hdf5"
  echo "$1: $number shards and the merged file have the bytes of one process"
}
same set

beside=$(sbatch --parsable "$folder/srun.sh")
while [ -n "$(left "$beside")" ]; do sleep 1; done
same srun || { cat "$folder/srun.out" >&2; exit 1; }
finish
trap - EXIT
rm -r "$folder"
