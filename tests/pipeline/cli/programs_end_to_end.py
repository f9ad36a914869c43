"""quadruped3d and quadruped3d-network: which of them links LibTorch, and how OpenMP's threads wait in it."""

import os
import pathlib
import shutil
import signal
import subprocess

from e2e import Case, Fault, program, run
from e2e.program import Started, environment

CONFIG = "held.json"


class Programs(Case):
    def network_process(self, starter, **variables):
        """Starts `build` and holds it where it opens its config: the environment, the libraries and the name of the
        process that was started."""
        (self.folder / CONFIG).write_text("{}")
        env = {name: value for name, value in environment(Fault(CONFIG, "open", action="stop")).items()
               if name not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
        env.update(variables)
        words = [str(starter), "build", "--config", str(self.folder / CONFIG), "--out", str(self.folder / "out")]
        running = Started(words, env)
        try:
            self.assertTrue(running.wait_for_stop(), running.stderr())
            process = pathlib.Path("/proc") / str(running.pid)
            variables = dict(entry.split("=", 1) for entry in (process / "environ").read_text().split("\0") if entry)
            libraries = (process / "maps").read_text()
            name = os.readlink(process / "exe")
            running.send(signal.SIGCONT)
            self.assertEqual(running.wait(), 2, running.stderr())  # the config names no dataset
            return variables, libraries, name
        finally:
            running.kill()

    def assert_waits(self, starter, policy, **variables):
        environ, libraries, name = self.network_process(starter, **variables)
        self.assertIn("libtorch_cpu", libraries)
        self.assertTrue(name.endswith("quadruped3d-network"), name)
        self.assertEqual(environ.get("OMP_WAIT_POLICY"), policy)

    def test_threads_wait_passively_however_the_program_is_started(self):
        link = self.folder / "link"
        link.symlink_to(program())
        for starter in (program(), link, program() + "-network"):
            with self.subTest(starter=starter):
                self.assert_waits(starter, "PASSIVE")

    def test_the_users_own_policy_is_kept(self):
        self.assert_waits(program(), "ACTIVE", OMP_WAIT_POLICY="ACTIVE")
        self.assert_waits(program(), None, GOMP_SPINCOUNT="100")

    def test_commands_without_a_network_load_no_libtorch(self):
        libraries = subprocess.run(["ldd", program()], capture_output=True, text=True, check=True).stdout
        self.assertNotIn("torch", libraries)
        self.assertIn("libhdf5", libraries)

    def test_the_help_names_every_command(self):
        text = run("--help").stdout
        for command in ("build", "verify", "train", "explain"):
            self.assertIn(f"\n  {command} ", text)
        self.assertIn("--threads", run("build", "--help").stdout)

    def test_a_missing_network_program_is_named(self):
        alone = self.folder / "quadruped3d"
        shutil.copy(program(), alone)
        result = subprocess.run([alone, "init", "--out", self.folder / "tiny.safetensors"], capture_output=True, text=True)
        self.assertEqual(result.returncode, 1)
        self.assertIn("quadruped3d-network is missing", result.stderr)
