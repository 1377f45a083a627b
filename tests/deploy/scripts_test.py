#!/usr/bin/env python3
"""What run.sh and test.sh say and return, whatever machine and options they are given.

The system is played by stand-ins in front of PATH, so nothing is installed, built or served.
"""

import contextlib
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest

SOURCE_DIR = pathlib.Path(__file__).resolve().parents[2]
RUN = str(SOURCE_DIR / "deploy/run.sh")
TEST = str(SOURCE_DIR / "deploy/test.sh")
LIBRARY = str(SOURCE_DIR / "deploy/lib.sh")
DEBIAN = 'ID=debian\nVERSION_ID="12"\n'
# Plays catgs-server: refuses --fps 900 as a check of its options, an empty scene when started,
# and otherwise says what the real one says, and ends.
SERVER = """
if [[ "$*" == *"--fps 900"* ]]; then echo "catgs-server: --fps: fps: too large" >&2; exit 2; fi
[[ "$*" != *--print-config* ]] || exit 0
for scene in "$@"; do
  [[ $scene == *.ply ]] || continue
  echo "12:00:00.000 info loading $scene"
  [[ $scene != *empty* ]] || { echo "catgs-server: --scene $scene: is empty" >&2; exit 2; }
  name=$(basename "$scene" .ply)
  echo "12:00:00.000 info scene $name: 10 Gaussians, 3DGS .ply, 0.1 MB per device, view from all"
done
echo "12:00:00.000 info renderer: CPU"
[[ "$*" == *--admin-bind* ]] || echo "12:00:00.000 info metrics: http://127.0.0.1:9090/metrics"
tokens=""
[[ "$*" != *--token-key-file* ]] || tokens="catgs-server token --token-key-file my key makes one"
[[ "$*" != *"--token-file"* ]] || tokens="a line of tokens.txt"
[[ -z $tokens ]] || echo "12:00:00.000 info visitors need a TOKEN in the address: $tokens"
echo "12:00:00.000 info open http://127.0.0.1:7/${tokens:+#token=TOKEN} in a browser; Ctrl-C stops the server"
"""


class Machine(unittest.TestCase):
    """A Debian without a GPU."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        (self.folder / "bin").mkdir()
        # A system PATH, so that neither a CUDA toolkit nor a sudo of this machine is found first.
        self.environment = {"PATH": f"{self.folder}/bin:/usr/bin:/bin", "HOME": str(self.folder),
                            "CATGS_OS_RELEASE": str(self.folder / "os-release"),
                            "CUDA_HOME": str(self.folder / "no-toolkit")}
        self.os_release(DEBIAN)
        self.stand_in("nvidia-smi", "exit 9")

    def os_release(self, text):
        (self.folder / "os-release").write_text(text)

    def stand_in(self, name, script):
        """A command in front of PATH; every call is recorded in `calls`."""
        path = self.folder / "bin" / name
        path.write_text(f'#!/bin/bash\necho "{name} $*" >>"{self.folder}/calls"\n{script}\n')
        path.chmod(0o755)

    def without_root_and_packages(self):
        for name, script in (("id", "echo 1000"), ("sudo", "exit 1"), ("dpkg-query", "exit 1")):
            self.stand_in(name, script)

    def calls(self):
        path = self.folder / "calls"
        return path.read_text() if path.exists() else ""

    def run_script(self, *command):
        return subprocess.run(command, env=self.environment, stdin=subprocess.DEVNULL, text=True,
                              capture_output=True, check=False, timeout=120)

    def run_library(self, commands):
        return self.run_script("bash", "-c", f'set -euo pipefail; source "{LIBRARY}"; {commands}')

    def free_port(self):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return str(probe.getsockname()[1])

    def options(self):
        return ["--port", self.free_port(), "--log", str(self.folder / "log")]


class Scripts(Machine):
    def test_other_distributions_are_shown_the_container(self):
        self.os_release('ID=fedora\nVERSION_ID=40\n')
        for script in (RUN, TEST):
            result = self.run_script(script)
            self.assertEqual(result.returncode, 4, result.stderr)
            self.assertIn("fedora 40", result.stderr)
            self.assertIn("docker run", result.stderr)

    def test_without_root_it_prints_the_line_and_installs_nothing(self):
        self.without_root_and_packages()
        self.stand_in("apt-get", "exit 0")
        result = self.run_script(RUN, *self.options())
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertRegex(result.stderr, r"apt-get install .*\bcmake\b.*\blibboost1\.81-dev\b")
        self.assertNotIn("apt-get", self.calls())

    def test_ubuntu_gets_its_own_boost(self):
        self.os_release('ID=ubuntu\nVERSION_ID="24.04"\n')
        self.without_root_and_packages()
        result = self.run_script(TEST, "--log", str(self.folder / "log"))
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertIn("libboost1.83-dev", result.stderr)
        self.assertIn("libgtest-dev", result.stderr)

    def test_the_full_tests_get_what_they_deploy_with(self):
        self.without_root_and_packages()
        for name in ("runc", "kubectl"):
            self.stand_in(name, "exit 0")
        options = ["--log", str(self.folder / "log")]
        result = self.run_script(TEST, "--full", *options)
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertRegex(result.stderr, r"\bbuildah\b.*\bprometheus\b")
        # They are there already, perhaps by packages that exclude Debian's.
        self.assertNotRegex(result.stderr, r"\brunc\b|\bkubernetes-client\b")
        self.assertRegex(result.stderr, r"\bclang .*\blibclang-rt-dev\b")
        self.assertNotRegex(self.run_script(TEST, *options).stderr, r"buildah|\bclang(?!-format)|libclang")

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
        name = pathlib.Path("/proc/self/comm").read_text().strip()
        self.assertIn(f": {name} (process {os.getpid()})\n", result.stderr)
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

    def test_long_steps_say_in_a_file_that_they_go_on(self):
        result = self.run_library(f'seconds_between_lines=1; steps_begin 1 "{self.folder}/log"; '
                                  'step Build bash -c "echo [3/7] Compiling; sleep 1.6"')
        self.assertRegex(result.stdout, r"^\[1/1\] Build +1\.\d s \[3/7\] …\n\[1/1\] Build +1\.\d s\n$")
        self.assertNotIn("\r", result.stdout)

    def test_a_failing_step_shows_the_end_of_its_own_output_and_the_log(self):
        log = self.folder / "log"
        result = self.run_library(f'steps_begin 2 "{log}"; step One echo early; '
                                  'step Two bash -c "echo the reason' + 40 * " is long" +
                                  ' to the end; exit 7"; echo never')
        self.assertEqual(result.returncode, 1)
        self.assertTrue(re.match(r"\[1/2\] One +0\.\d s\n$", result.stdout), result.stdout)
        self.assertIn("[2/2] Two: FAILED (status 7)", result.stderr)
        self.assertIn("the reason" + 40 * " is long" + " to the end\n", result.stderr)
        self.assertNotIn("early", result.stderr)
        self.assertIn(str(log), result.stderr)


class Serving(Machine):
    """run.sh to its end: a checkout whose build makes stand-ins for the programs."""

    def setUp(self):
        super().setUp()
        self.checkout = self.folder / "checkout"
        shutil.copytree(SOURCE_DIR / "deploy", self.checkout / "deploy",
                        ignore=shutil.ignore_patterns("media"))
        self.bin = self.checkout / "build/run/bin"
        self.bin.mkdir(parents=True)
        for name, script in (("catgs-server", SERVER), ("catgs-render", 'touch "${@: -1}"')):
            self.stand_in(name, script)
            (self.folder / "bin" / name).rename(self.bin / name)
        self.stand_in("dpkg-query", 'shift 2; for p; do echo "installed $p"; done')
        for name in ("cmake", "ninja"):
            self.stand_in(name, "exit 0")

    def scene(self, name):
        path = self.folder / name
        path.touch()
        return str(path)

    def serve(self, *arguments):
        return self.run_script(str(self.checkout / "deploy/run.sh"), *arguments)

    def server_calls(self):
        return [c for c in self.calls().splitlines() if c.startswith("catgs-server ")]

    def test_its_own_options_and_scenes_stand_anywhere(self):
        port, scene, log = self.free_port(), self.scene("a.ply"), str(self.folder / "log")
        groups = (["--encoder", "jpeg"], ["--port", port], ["--fps=30"], [scene], ["--lod", "-1"],
                  ["--no-cuda"], ["--open"], ["--log", log])
        for order in (groups, groups[::-1]):
            (self.folder / "calls").unlink(missing_ok=True)
            result = self.serve(*sum(order, []))
            self.assertIn("stop      Ctrl-C", result.stdout, result.stderr)
            call = self.server_calls()[-1]
            self.assertIn(f" --scene {scene} --port {port} ", call)
            for option in ("--encoder jpeg", "--fps=30", "--lod -1", "--open"):
                self.assertIn(option, call)
            for own in ("--no-cuda", "--log " + log):
                self.assertNotIn(own, call)
            self.assertTrue(pathlib.Path(log).exists())

    def test_a_wrong_value_ends_with_its_status_before_a_scene_is_made(self):
        result = self.serve("--fps", "900", *self.options())
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertIn("catgs-server: --fps: fps: too large\n", result.stderr)
        self.assertIn("build/run/bin/catgs-server --help", result.stderr)
        self.assertNotIn("catgs-render", self.calls())
        self.assertEqual(len(self.server_calls()), 1)

    def test_the_load_generator_is_built_by_one_option(self):
        for option, setting in ((["--with-load"], "ON"), ([], "OFF")):
            self.serve(*option, "--port", self.free_port())
            self.assertIn(f"-DCATGS_LOAD={setting}", self.calls())
            (self.folder / "calls").unlink()

    def test_two_in_one_clone_build_one_after_the_other(self):
        self.stand_in("ninja", 'echo begin >>"$HOME/order"; sleep 1; echo end >>"$HOME/order"')
        outputs = []
        first = threading.Thread(target=lambda: outputs.append(self.serve(*self.options()).stdout))
        first.start()
        while not (self.folder / "order").exists():
            time.sleep(0.05)
        second = self.serve("--port", self.free_port())
        first.join()
        self.assertIn("Another script builds in", second.stdout)
        self.assertIn("stop      Ctrl-C", second.stdout, second.stderr)
        self.assertIn("stop      Ctrl-C", outputs[0])
        self.assertNotIn("Another script", outputs[0])
        self.assertEqual((self.folder / "order").read_text().split(), ["begin", "end"] * 2)

    @contextlib.contextmanager
    def serving(self, server):
        """run.sh while this stand-in of the server runs."""
        self.stand_in("serves", server)
        (self.folder / "bin/serves").rename(self.bin / "catgs-server")
        with subprocess.Popen([str(self.checkout / "deploy/run.sh"), *self.options()],
                              env=self.environment, stdout=subprocess.PIPE, text=True) as script:
            while "Try" not in script.stdout.readline():
                pass
            yield script

    def test_a_server_that_runs_keeps_nobody_from_building(self):
        with self.serving(SERVER + "exec sleep 30") as script:
            lock = self.checkout / "build/run/.lock"
            self.assertEqual(subprocess.run(["flock", "-n", str(lock), "true"], check=False).returncode, 0)
            script.terminate()

    def test_the_server_gets_the_signal_that_ends_the_script(self):
        # SIGINT is a person who waits for the prompt, SIGTERM a supervisor: only for that it drains.
        for name in ("INT", "TERM"):
            record = self.folder / f"got-{name}"
            traps = "".join(f"trap 'echo {s} >{record}; exit 0' {s}\n" for s in ("INT", "TERM"))
            with self.serving(traps + SERVER + "while :; do sleep 0.05; done") as script:
                script.send_signal(getattr(signal, f"SIG{name}"))
                self.assertRegex(script.stdout.read(), r"\nStopping: .*\nStopped\.\n$")
            self.assertEqual(script.returncode, 0)
            self.assertEqual(record.read_text(), f"{name}\n")

    def test_a_scene_that_fails_shows_the_error_and_not_the_progress(self):
        result = self.serve(self.scene("empty.ply"), *self.options())
        self.assertEqual(result.returncode, 1)
        self.assertIn("empty.ply: is empty\n", result.stderr)
        self.assertNotIn("loading", result.stderr)

    def test_each_of_several_scenes_gets_its_address(self):
        scenes = [self.scene("a.ply"), self.scene("my room #2.ply")]
        output = self.serve(*scenes, *self.options()).stdout
        self.assertRegex(output, r"  scenes +http://127\.0\.0\.1:7/\?scene=a\n"
                                 r" +http://127\.0\.0\.1:7/\?scene=my%20room%20%232\n")
        self.assertNotIn("?scene=", self.serve(scenes[0], *self.options()).stdout)

    def test_a_procedural_scene_is_no_file(self):
        result = self.serve("synth:city:20000", *self.options())
        self.assertIn("stop      Ctrl-C", result.stdout, result.stderr)
        self.assertIn(" --scene synth:city:20000 ", self.server_calls()[-1])
        result = self.serve("city:20000", *self.options())
        self.assertEqual(result.returncode, 2)
        self.assertIn("No such scene: city:20000", result.stderr)

    def test_links_are_told_where_the_address_needs_a_token(self):
        scene = self.scene("my room.ply")
        link = (f"  link      {self.bin}/catgs-server token --token-key-file my\\ key "
                "--address http://127.0.0.1:7/ --scene my\\ room")
        for options, wanted in ((["--token-key-file", "my key"], link),
                                (["--token-file", "tokens.txt"], "  link      TOKEN is a line of tokens.txt"),
                                (["--open"], None)):
            output = self.serve(scene, *options, *self.options()).stdout
            self.assertEqual("#token=TOKEN\n" in output, wanted is not None)
            self.assertEqual([line.rstrip() for line in output.splitlines() if "  link " in line],
                             [wanted] if wanted else [])

    def test_hints_are_for_what_was_not_done(self):
        output = self.serve(*self.options()).stdout
        self.assertIn("your_scene.ply", output)
        self.assertIn("--lan", output)
        output = self.serve(self.scene("a.ply"), *self.options()).stdout
        self.assertNotIn("your_scene.ply", output)
        self.assertIn("--lan", output)

    def test_the_ground_of_the_demo_scenes_is_found_once(self):
        output = self.serve(*self.options()).stdout
        self.assertIn("] Find where people walk in the demo scenes ", output)
        scenes = self.checkout / "build/run/scenes"
        self.assertTrue((scenes / "city.walk").exists())
        self.assertTrue((scenes / "garden.walk").exists())
        found = self.calls().count("catgs-render floors")
        self.assertEqual(found, 2)
        self.assertIn("] Where people walk in the demo scenes: already found ", self.serve(*self.options()).stdout)
        self.assertEqual(self.calls().count("catgs-render floors"), found)
        newer = time.time() + 10
        os.utime(scenes / "garden.ply", (newer, newer))
        self.serve(*self.options())
        self.assertEqual(self.calls().count("catgs-render floors"), found + 1)
        self.assertNotIn("where people walk", self.serve(self.scene("a.ply"), *self.options()).stdout)

    def test_metrics_move_out_of_the_way_of_the_page(self):
        script = self.checkout / "deploy/run.sh"
        port = self.free_port()
        script.write_text(script.read_text().replace("admin_port=9090", f"admin_port={port}"))
        output = self.serve(*self.options()).stdout
        self.assertIn("  metrics   http://127.0.0.1:9090/metrics\n", output)
        output = self.serve("--port", port).stdout
        self.assertIn(f"  metrics   off: port {port} serves the page", output)
        self.assertIn("--admin-bind off", self.server_calls()[-1])
        with socket.create_server(("127.0.0.1", int(port))):
            output = self.serve(*self.options()).stdout
            self.assertIn(f"  metrics   off: port {port} is busy", output)
            self.assertIn("--admin-bind off", self.server_calls()[-1])
            self.serve("--admin-bind", "127.0.0.1:9", *self.options())
            self.assertNotIn("--admin-bind off", self.server_calls()[-1])

    def test_each_port_has_a_log_of_its_own(self):
        ports = [self.free_port(), self.free_port()]
        for port in ports:
            self.serve("--port", port)
        for port in ports:
            log = self.checkout / f"build/run/server-{port}.log"
            self.assertIn("in a browser", log.read_text())


if __name__ == "__main__":
    unittest.main()
