"""tools/slurm on a real Slurm of one node: a controller and a daemon on this machine, started by the test."""

import fcntl
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest

from e2e import (LIMIT_S, Fault, SmallUnitsCase, draw_pictures, environment, give_bodies, make_network, prima_dataset,
                 program, run, wait_until, write_annotations, write_json)

ROOT = pathlib.Path(__file__).resolve().parents[2]
NEEDED = ("munged", "slurmctld", "slurmd", "srun", "sbatch", "scontrol", "squeue", "scancel")

CONFIG = """\
ClusterName=q3dtest
SlurmctldHost=localhost(127.0.0.1)
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket={folder}/munge.sock
SlurmUser=root
SlurmdUser=root
SlurmctldPort={controller}
SlurmdPort={daemon}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName=localhost NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN
PartitionName=all Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""


class Cluster:
    """Slurm with its files in one folder, under a short path, since a socket's path may not be long."""

    def __init__(self):
        # One at a time on a machine: two of them disturb each other's jobs.
        self.only = open(pathlib.Path(tempfile.gettempdir(), "q3d_slurm_test.lock"), "w")
        fcntl.flock(self.only, fcntl.LOCK_EX)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="q3dslurm"))
        self.folder.chmod(0o755)
        for name in ("state", "spool", "munge"):
            (self.folder / name).mkdir(mode=0o700)
        key = self.folder / "munge/key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        port = 20000 + 2 * (os.getpid() % 10000)  # two ports of its own beside another test's
        self.config = self.folder / "slurm.conf"
        self.config.write_text(CONFIG.format(folder=self.folder, controller=port, daemon=port + 1))
        self.processes = []
        munge = {"key-file": "munge/key", "socket": "munge.sock", "pid-file": "munge/pid", "log-file": "munge/log",
                 "seed-file": "munge/seed"}
        self.start("munged", "--foreground", "--force",
                   *(f"--{name}={self.folder / file}" for name, file in munge.items()))
        wait_until((self.folder / "munge.sock").exists, "munged")
        self.start("slurmctld", "-D", "-f", self.config)
        self.start("slurmd", "-D", "-N", "localhost", "-f", self.config)
        wait_until(self.is_idle, "the node to be idle")

    def start(self, *words):
        log = open(self.folder / f"{words[0]}.log", "w")
        self.processes.append(subprocess.Popen(list(map(str, words)), stdout=log, stderr=log))
        log.close()

    def environment(self):
        return {**os.environ, "SLURM_CONF": str(self.config)}

    def ask(self, *words, check=True, env=None):
        result = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=LIMIT_S,
                                env=env or self.environment())
        if check and result.returncode != 0:
            raise AssertionError(f"{words}: {result.stderr}")
        return result.stdout

    def is_idle(self):
        """Whether no job is on the node, nor what is left of one."""
        return "idle" in self.ask("sinfo", "-h", "-o", "%t", check=False)

    def shown(self, job, field):
        """A field of `scontrol show job`."""
        words = self.ask("scontrol", "show", "job", job, "-o").split()
        return next(word.split("=", 1)[1] for word in words if word.startswith(field + "="))

    def state(self, job):
        return self.shown(job, "JobState")

    def restarts(self, job):
        """How often the job was queued again."""
        return int(self.shown(job, "Restarts"))

    def end(self):
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            process.wait(LIMIT_S)
        shutil.rmtree(self.folder, ignore_errors=True)


@unittest.skipUnless(all(shutil.which(name) for name in NEEDED),
                     "Slurm is not installed; apt-get install slurmctld slurmd slurm-client munge")
@unittest.skipUnless(os.geteuid() == 0, "slurmd starts tasks as their user, for which it must be root")
class Slurm(SmallUnitsCase):
    def setUp(self):
        super().setUp()
        self.cluster = Cluster()
        self.addCleanup(self.cluster.end)

    def program_that(self, first):
        """A script that runs the program with a fault in the job's first start, and without it in later ones."""
        fault = "\n".join(f"  export {name}='{value}'" for name, value in environment(first).items()
                          if name.startswith(("Q3D_FAULT_", "LD_PRELOAD")))
        script = self.folder / "quadruped3d.sh"
        script.write_text(f"#!/bin/bash\nif [ \"${{SLURM_RESTART_COUNT:-0}}\" = 0 ]; then\n{fault}\nfi\n"
                          f"exec {program()} \"$@\"\n")
        script.chmod(0o755)
        return script

    def submit(self, script, *words, quadruped3d=None):
        env = {**self.cluster.environment(), "QUADRUPED3D": str(quadruped3d or program()), "GLOO_SOCKET_IFNAME": "lo"}
        self.log = self.folder / "job.log"
        return self.cluster.ask("sbatch", "--parsable", "--ntasks=2", f"--output={self.log}",
                                ROOT / "tools/slurm" / script, *words, env=env).strip()

    def said(self):
        """What the job has written so far."""
        return self.log.read_text() if self.log.exists() else ""

    def wait_for(self, job, state):
        def reached():
            now = self.cluster.state(job)
            self.assertFalse(now in ("COMPLETED", "FAILED") and now != state, f"{now}\n{self.said()}")
            return now == state

        wait_until(reached, f"job {job} to be {state}")

    def wait_until_a_rank_hangs(self, job):
        def hangs():
            if "faults: hang" in self.said():
                return True
            now = self.cluster.state(job)
            self.assertIn(now, ("PENDING", "CONFIGURING", "RUNNING"), f"no rank came to its fault\n{self.said()}")
            return False

        wait_until(hangs, "a rank to be at work")

    def preempt_and_complete(self, job):
        """Ends the first start of the job by SIGTERM and waits until another start completes it."""
        self.wait_until_a_rank_hangs(job)
        self.cluster.ask("scancel", "--signal=TERM", job)
        self.wait_for(job, "PENDING")
        # Slurm holds the job back for two minutes, and the test for a few seconds. The node must be free of the first
        # start, and it refuses a start in the second in which the one before was ended ("job credential revoked").
        wait_until(self.cluster.is_idle, "the first start to end")
        self.cluster.ask("scontrol", "update", f"JobId={job}", "StartTime=now+3")
        self.wait_for(job, "COMPLETED")
        self.assertEqual(self.cluster.restarts(job), 1)

    def test_two_tasks_build_the_bytes_of_one_process(self):
        words = self.scene.build_words("out", config=self.config)[1:]
        self.wait_for(self.submit("build.sbatch", *words), "COMPLETED")
        self.assert_equals_one()

    def test_a_build_that_is_preempted_is_queued_again_and_completes(self):
        words = self.scene.build_words("out", config=self.config)[1:]
        script = self.program_that(Fault("shards-", "sync", "hang", skip=4))
        self.preempt_and_complete(self.submit("build.sbatch", *words, quadruped3d=script))
        self.assert_equals_one()

    def test_a_training_that_is_preempted_goes_on_from_its_state(self):
        folder = self.folder
        make_network(folder / "initial.safetensors", body=folder / "smal.safetensors",
                     priors=folder / "priors.safetensors")
        write_annotations(folder / "data", give_bodies(draw_pictures(folder / "data", 12)))
        pool = write_json(folder / "pool.json", {"name": "packed", "shards": {"unit_size": 6},
                                                 "datasets": [prima_dataset(folder / "data", role="truth")]})
        run("build", "--config", pool, "--out", folder / "pool")
        network = {"initial": "initial.safetensors", "smal_asset": "smal.safetensors", "priors": "priors.safetensors"}
        config = write_json(folder / "train.json", {
            "network": {**{key: str(folder / file) for key, file in network.items()}, "device": "cpu",
                        "compute_threads": 1},
            "pools": {"truth": {"shards": [str(folder / "pool/latest")]}},
            "stages": {"1": [{"name": "joint", "pools": ["truth"], "steps": 6, "learning_rate": 1e-3}]},
            "batch": 4, "log_every": 1, "checkpoint_every": 1})
        # The third saved state hangs in rank 0; the signal then ends both ranks.
        script = self.program_that(Fault("state.safetensors", "sync", "hang", skip=2))
        job = self.submit("train.sbatch", "--config", config, "--stage", "1", "--out", folder / "run",
                          quadruped3d=script)
        self.preempt_and_complete(job)
        steps = [line for line in (folder / "run/log.jsonl").read_text().splitlines() if line]
        self.assertEqual(len(steps), 6)
        self.assertTrue((folder / "run/model.safetensors").exists())
