"""A small Slurm of its own on this machine: munged, slurmctld and two nodes of two processors each, in a folder that is removed at the end.

`with Cluster() as cluster:` starts the daemons and stops them however the block ends; `absent()` says what is missing for it. Nothing
outside the folder is written and no service of the machine is used: own key, own sockets, own ports, no control groups, no systemd.
"""
import atexit
import ctypes
import os
import pathlib
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

DAEMONS = ("munged", "slurmctld", "slurmd")
CLIENTS = ("sbatch", "srun", "scontrol", "squeue", "scancel", "sinfo")
NODES = ("node1", "node2")
FINAL = ("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL", "OUT_OF_MEMORY", "BOOT_FAIL", "DEADLINE", "PREEMPTED")

CONFIGURATION = """
ClusterName=dotyk
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
PlugStackConfig={folder}/plugstack.conf
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
TmpFS={folder}/tmp-%n
JobAcctGatherType=jobacct_gather/none
JobCompType=jobcomp/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
ReturnToService=2
KillWait=20
MinJobAge=3600
TreeWidth=2
NodeName={nodes[0]} NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=2 RealMemory=2000 State=UNKNOWN
NodeName={nodes[1]} NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=2 RealMemory=2000 State=UNKNOWN
PartitionName=test Nodes=ALL Default=YES MaxTime=10 State=UP
"""


def absent():
    """What this machine lacks for a cluster of its own, or an empty text."""
    missing = [name for name in DAEMONS + CLIENTS if not program(name)]
    if missing:
        return "Slurm is not installed (%s): tools/setup.sh --slurm installs it" % ", ".join(missing)
    return ""


def program(name):
    """Path of a program; daemons are not in everybody's path."""
    return shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")


def free_ports(number):
    """Ports that nobody listens on."""
    sockets = [socket.socket() for _ in range(number)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()


def end_with_parent():
    """A daemon is sent SIGTERM when the test is killed (PR_SET_PDEATHSIG)."""
    ctypes.CDLL(None).prctl(1, int(signal.SIGTERM))


class Cluster:
    ended = False
    environment = None

    def __enter__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="dotyk-slurm-"))
        self.folder.chmod(0o755)
        self.daemons = []
        # Also where the tests are interrupted; unittest does not clean up then.
        atexit.register(self.__exit__)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
        try:
            self.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        """Stop jobs, nodes, controller and munged, in this order, each by its own number."""
        if self.ended:
            return
        self.ended = True
        if self.environment:
            subprocess.run([program("scancel"), "--full", "--signal=KILL", "--user=%d" % os.getuid()], env=self.environment,
                           timeout=30, capture_output=True, check=False)
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in reversed(self.daemons):
            try:
                daemon.wait(15)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        for pid in self.left():
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        if os.environ.get("DOTYK_KEEP"):
            print("slurm: kept %s" % self.folder)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)

    def left(self):
        """Processes of this cluster that are still there: those whose environment names its configuration."""
        found = []
        mark = b"SLURM_CONF=%s" % str(self.folder / "slurm.conf").encode()
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if int(entry.name) != os.getpid() and mark in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                pass
        return found

    def processes(self, path):
        """Processes of this cluster that run the program."""
        def runs(pid):
            try:
                return os.path.samefile("/proc/%d/exe" % pid, path)
            except OSError:
                return False
        return [pid for pid in self.left() if runs(pid)]

    def steps(self):
        """Steps of jobs whose managers are still there."""
        def manages(pid):
            try:
                return pathlib.Path("/proc/%d/comm" % pid).read_text().startswith("slurmstepd")
            except OSError:
                return False
        return [pid for pid in self.left() if manages(pid)]

    def start(self):
        """Configuration and daemons."""
        for name in ("state", *("%s-%s" % (kind, node) for kind in ("spool", "tmp") for node in NODES)):
            (self.folder / name).mkdir()
        (self.folder / "plugstack.conf").write_text("")
        (self.folder / "munge.key").write_bytes(os.urandom(128))
        (self.folder / "munge.key").chmod(0o600)
        (self.folder / "slurm.conf").write_text(CONFIGURATION.format(
            host=socket.gethostname().split(".")[0], ports=free_ports(3), user=pwd.getpwuid(os.getuid()).pw_name,
            folder=self.folder, nodes=NODES))
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("SLURM", "SBATCH", "OMPI_", "PMIX_"))}
        self.environment = {**environment, "SLURM_CONF": str(self.folder / "slurm.conf")}
        part = {name: "--%s=%s/munge.%s" % (option, self.folder, name) for option, name in
                (("key-file", "key"), ("socket", "socket"), ("log-file", "log"), ("pid-file", "pid"), ("seed-file", "seed"))}
        self.daemon("munged", "--foreground", "--force", *part.values())
        self.wait_for(lambda: (self.folder / "munge.socket").exists(), "munged", 10)
        self.daemon("slurmctld", "-D", "-i")
        for node in NODES:
            self.daemon("slurmd", "-D", "-N", node)
        self.wait_for(lambda: self.ask("sinfo", "-h", "-t", "idle", "-o", "%D") == str(len(NODES)), "nodes", 60)

    def daemon(self, name, *words):
        """A daemon in the foreground, with what it says in a file."""
        with open(self.folder / "daemons.txt", "ab") as text:
            self.daemons.append(subprocess.Popen([program(name), *words], cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL,
                                                 stdout=text, stderr=subprocess.STDOUT, start_new_session=True,
                                                 preexec_fn=end_with_parent))

    def wait_for(self, condition, what, seconds):
        """Wait until a condition holds; TimeoutError with the daemons' last words where it never does."""
        limit = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > limit or any(daemon.poll() is not None for daemon in self.daemons):
                raise TimeoutError("%s: not ready after %d s\n%s" % (what, seconds, self.words()))
            time.sleep(0.2)

    def words(self):
        """The end of what the daemons said."""
        logs = sorted([*self.folder.glob("*.log"), self.folder / "daemons.txt"])
        return "\n".join("--- %s\n%s" % (log.name, log.read_text(errors="replace")[-2000:]) for log in logs if log.exists())

    def ask(self, name, *words, check=False):
        """What a client prints, without the blanks at its ends."""
        done = subprocess.run([program(name), *map(str, words)], env=self.environment, cwd=self.folder, timeout=60, text=True,
                              capture_output=True, check=False)
        if check and done.returncode:
            raise RuntimeError("%s %s: %s" % (name, " ".join(map(str, words)), done.stderr))
        return done.stdout.strip()

    def submit(self, *words, cwd, **environment):
        """Number of a job that sbatch takes."""
        done = subprocess.run([program("sbatch"), "--parsable", *map(str, words)], env={**self.environment, **environment}, cwd=cwd,
                              timeout=60, text=True, capture_output=True, check=False)
        if done.returncode:
            raise RuntimeError("sbatch: " + done.stderr)
        return done.stdout.strip().split(";")[0]

    def job(self, number):
        """What the controller knows of a job, by its names: JobState, ExitCode, Restarts, Requeue, ..."""
        text = self.ask("scontrol", "show", "job", "-o", number).splitlines()
        return [dict(word.split("=", 1) for word in line.split() if "=" in word) for line in text]

    def wait_job(self, number, states=FINAL, seconds=120):
        """Wait until all parts of a job are in one of the states; the parts."""
        found = []

        def reached():
            found[:] = self.job(number)
            return found and all(part.get("JobState") in states for part in found)
        self.wait_for(reached, "job %s: %s" % (number, found), seconds)
        return found
