#!/usr/bin/env python3
"""What run.sh and test.sh say and return when the machine is not as they need it.

The system is played by stand-ins in front of PATH, so nothing is installed, built or served.
"""

import os
import pathlib
import re
import socket
import subprocess
import tempfile
import unittest

SOURCE_DIR = pathlib.Path(__file__).resolve().parents[2]
RUN = str(SOURCE_DIR / "deploy/run.sh")
TEST = str(SOURCE_DIR / "deploy/test.sh")
LIBRARY = str(SOURCE_DIR / "deploy/lib.sh")
DEBIAN = 'ID=debian\nVERSION_ID="12"\n'


class Scripts(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        (self.folder / "bin").mkdir()
        self.os_release(DEBIAN)
        self.stand_in("nvidia-smi", "exit 9")

    def os_release(self, text):
        (self.folder / "os-release").write_text(text)

    def stand_in(self, name, script):
        """A command in front of PATH; every call is recorded in `calls`."""
        path = self.folder / "bin" / name
        path.write_text(f'#!/bin/bash\necho "{name} $*" >>"{self.folder}/calls"\n{script}\n')
        path.chmod(0o755)

    def calls(self):
        path = self.folder / "calls"
        return path.read_text() if path.exists() else ""

    def run_script(self, *command):
        # A system PATH, so that neither a CUDA toolkit nor a sudo of this machine is found first.
        environment = {"PATH": f"{self.folder}/bin:/usr/bin:/bin", "HOME": str(self.folder),
                       "CATGS_OS_RELEASE": str(self.folder / "os-release"),
                       "CUDA_HOME": str(self.folder / "no-toolkit")}
        return subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, text=True,
                              capture_output=True, check=False, timeout=120)

    def run_library(self, commands):
        return self.run_script("bash", "-c", f'set -euo pipefail; source "{LIBRARY}"; {commands}')

    def free_port(self):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return str(probe.getsockname()[1])

    def options(self):
        return ["--port", self.free_port(), "--log", str(self.folder / "log")]

    def test_other_distributions_are_shown_the_container(self):
        self.os_release('ID=fedora\nVERSION_ID=40\n')
        for script in (RUN, TEST):
            result = self.run_script(script)
            self.assertEqual(result.returncode, 4, result.stderr)
            self.assertIn("fedora 40", result.stderr)
            self.assertIn("docker run", result.stderr)

    def test_without_root_it_prints_the_line_and_installs_nothing(self):
        self.stand_in("id", "echo 1000")
        self.stand_in("sudo", "exit 1")
        self.stand_in("dpkg-query", "exit 1")
        self.stand_in("apt-get", "exit 0")
        result = self.run_script(RUN, *self.options())
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertRegex(result.stderr, r"apt-get install .*\bcmake\b.*\blibboost1\.81-dev\b")
        self.assertNotIn("apt-get", self.calls())

    def test_ubuntu_gets_its_own_boost(self):
        self.os_release('ID=ubuntu\nVERSION_ID="24.04"\n')
        self.stand_in("id", "echo 1000")
        self.stand_in("sudo", "exit 1")
        self.stand_in("dpkg-query", "exit 1")
        result = self.run_script(TEST, "--log", str(self.folder / "log"))
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertIn("libboost1.83-dev", result.stderr)
        self.assertIn("libgtest-dev", result.stderr)

    def test_packages_are_listed_before_they_are_installed_and_none_is_removed(self):
        self.stand_in("id", "echo 0")
        self.stand_in("dpkg-query", 'shift 2; for p; do [[ $p == cmake ]] || echo "installed $p"; done')
        self.stand_in("apt-get", 'echo E: no such mirror; [[ "$*" != *install* ]]')
        result = self.run_script(RUN, *self.options())
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        self.assertRegex(result.stdout, r"To be installed with apt-get:\n +cmake\n")
        self.assertRegex(self.calls(), r"apt-get .*install -y --no-remove .* cmake\n")
        self.assertIn("E: no such mirror", result.stderr)
        self.assertIn(str(self.folder / "log"), result.stderr)

    def test_a_busy_port_is_named_with_its_owner_and_the_remedy(self):
        with socket.create_server(("127.0.0.1", 0)) as holder:
            port = holder.getsockname()[1]
            result = self.run_script(RUN, "--port", str(port))
        self.assertEqual(result.returncode, 5, result.stdout + result.stderr)
        self.assertIn(f"Port {port} is in use by", result.stderr)
        self.assertIn(f"process {os.getpid()}", result.stderr)
        self.assertIn("--port", result.stderr.splitlines()[-1])

    def test_wrong_usage(self):
        for arguments, text in ((["--port", "http"], "--port http"), (["--port"], "needs a value"),
                                (["--port", "70000"], "1 to 65535"),
                                (["--log-level", "warn"], "--log-level"),
                                (["nowhere.ply"], "nowhere.ply")):
            result = self.run_script(RUN, *arguments)
            self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
            self.assertIn(text, result.stderr)
        self.assertEqual(self.run_script(TEST, "--fast").returncode, 2)

    def test_help(self):
        for script in (RUN, TEST):
            result = self.run_script(script, "--help")
            self.assertEqual(result.returncode, 0)
            self.assertIn("usage: deploy/", result.stdout)

    def test_cuda_needs_a_gpu_and_nvcc(self):
        choose = 'choose_cuda; echo "$cuda_choice: $cuda_note"'
        self.assertTrue(self.run_library(choose).stdout.startswith("OFF: "))
        self.stand_in("nvidia-smi", "echo NVIDIA Test 9000")
        self.assertEqual(self.run_library(choose).stdout, "OFF: NVIDIA Test 9000, but no nvcc\n")
        self.stand_in("nvcc", "exit 0")
        self.assertEqual(self.run_library(choose).stdout, "ON: NVIDIA Test 9000\n")
        self.stand_in("nvidia-smi", 'case $1 in *compute_cap*) echo 7.5 ;; *) echo NVIDIA Old ;; esac')
        self.assertTrue(self.run_library(choose).stdout.startswith("OFF: NVIDIA Old, which is older"))

    def test_a_failing_step_shows_the_end_of_its_own_output_and_the_log(self):
        log = self.folder / "log"
        result = self.run_library(f'steps_begin 2 "{log}"; step One echo early; '
                                  'step Two bash -c "echo the reason; exit 7"; echo never')
        self.assertEqual(result.returncode, 1)
        self.assertTrue(re.match(r"\[1/2\] One +0\.\d s\n$", result.stdout), result.stdout)
        self.assertIn("[2/2] Two: FAILED (status 7)", result.stderr)
        self.assertIn("the reason", result.stderr)
        self.assertNotIn("early", result.stderr)
        self.assertIn(str(log), result.stderr)


if __name__ == "__main__":
    unittest.main()
