"""A drive on dask.distributed: the bytes of one process although workers are killed, and a clear end of what fails."""

import os
import re
import signal
import socket
import subprocess
import sys

import pytest
from conftest import PROGRAM, SAMPLE

distributed = pytest.importorskip("distributed")

from chainage import dask as driver  # noqa: E402

OPTIONS = ["--method", "euclidean", "--ground", "voxel-column", "--tile-length", "10"]


def alone(folder):
    command = [PROGRAM, "run", SAMPLE, "-o", folder, "--progress", "none", *OPTIONS]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def same(one, other):
    for name in (SAMPLE.name, "objects.csv", "objects.geojson"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_the_command_gives_the_bytes_of_one_process(tmp_path):
    alone(tmp_path / "alone")
    command = [sys.executable, "-m", "chainage.dask", SAMPLE, "-o", tmp_path / "out", "--workers", "2", *OPTIONS]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "ground: " in done.stderr and "finished" in done.stderr
    same(tmp_path / "alone", tmp_path / "out")


def test_killed_workers_change_no_byte(tmp_path):
    alone(tmp_path / "alone")
    killed = []
    with driver.local_cluster(2) as cluster, distributed.Client(cluster, set_as_default=False) as client:

        def kill(text):
            # When a part of the units of a pass is done, others are under way.
            part = re.search(r": (\d+) of (\d+) units", text)
            processes = [worker.pid for worker in cluster.workers.values() if worker.pid]
            if part and int(part[1]) < int(part[2]) and processes and len(killed) < 4:
                os.kill(processes[len(killed) % len(processes)], signal.SIGKILL)
                killed.append(text)

        driver.drive(client, [str(SAMPLE)], str(tmp_path / "out"), OPTIONS, ["--wait", "0"], kill)
    assert killed, "no worker was killed"
    same(tmp_path / "alone", tmp_path / "out")


def test_a_unit_that_fails_three_times_ends_the_run(tmp_path, monkeypatch):
    log = tmp_path / "calls"
    broken = tmp_path / "broken"
    broken.write_text(
        f'#!/bin/sh\nif [ "$1" = work ] && [ "$4" = ground ]; then echo "$6" >>{log}; echo "error: no" >&2; exit 8; fi\n'
        f'exec {PROGRAM} "$@"\n'
    )
    broken.chmod(0o755)
    monkeypatch.setenv("CHAINAGE_PROGRAM", str(broken))
    with driver.local_cluster(1) as cluster, distributed.Client(cluster, set_as_default=False) as client:
        with pytest.raises(driver.Ended, match="of pass ground failed 3 times, the last time:\nerror: no") as ended:
            driver.drive(client, [str(SAMPLE)], str(tmp_path / "out"), OPTIONS, ["--wait", "0"], lambda text: None)
    assert ended.value.code == 8
    calls = log.read_text().splitlines()
    assert max(calls.count(units) for units in set(calls)) == 3


def test_what_cannot_be_helped_is_not_tried_again(tmp_path, monkeypatch):
    log = tmp_path / "calls"
    refusing = tmp_path / "refusing"
    refusing.write_text(
        f'#!/bin/sh\nif [ "$1" = work ]; then echo called >>{log}; echo "error: is in use" >&2; exit 7; fi\nexec {PROGRAM} "$@"\n'
    )
    refusing.chmod(0o755)
    monkeypatch.setenv("CHAINAGE_PROGRAM", str(refusing))
    with driver.local_cluster(1) as cluster, distributed.Client(cluster, set_as_default=False) as client:
        with pytest.raises(driver.Ended, match="is in use") as ended:
            driver.drive(client, [str(SAMPLE)], str(tmp_path / "out"), OPTIONS, ["--wait", "0"], lambda text: None)
    assert ended.value.code == 7
    assert log.read_text().splitlines() == ["called"]


def test_no_port_is_open_to_other_hosts(tmp_path):
    with driver.local_cluster(1) as cluster:
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
        port = int(cluster.scheduler_address.rsplit(":", 1)[1])
        outside = {facts[4][0] for facts in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
        for address in outside - {"127.0.0.1", "127.0.1.1"}:
            with socket.socket() as connection:
                connection.settimeout(1)
                assert connection.connect_ex((address, port)) != 0, address


@pytest.mark.parametrize(
    ("units", "parts", "expected"),
    [([0, 1, 2, 5], 2, ["0,1", "2,5"]), ([3], 4, ["3"]), ([0, 1, 2], 2, ["0", "1,2"])],
)
def test_batches_have_every_unit_once(units, parts, expected):
    assert driver.batches(units, parts) == expected


def test_relative_paths_are_those_of_the_driver(tmp_path, monkeypatch):
    alone(tmp_path / "alone")
    here, elsewhere = tmp_path / "here [1]", tmp_path / "elsewhere"
    here.mkdir()
    elsewhere.mkdir()
    (here / SAMPLE.name).symlink_to(SAMPLE)
    monkeypatch.chdir(elsewhere)
    with driver.local_cluster(1) as cluster:
        monkeypatch.chdir(here)
        options = ["-o", "out", "--scheduler", cluster.scheduler_address, "--memory", "256M", "-q", *OPTIONS]
        assert driver.main(["*.laz", *options]) == 0
    same(tmp_path / "alone", here / "out")
    assert os.listdir(elsewhere) == []


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/drive/*.laz", "/drive/*.laz"),
        ("", ""),
        ("a.laz", "{here}/a.laz"),
        ("*.laz", "{escaped}/*.laz"),
        ("is[here].laz", "{here}/is[here].laz"),
    ],
)
def test_absolute_paths_and_patterns_mean_the_same(tmp_path, monkeypatch, path, expected):
    here = tmp_path / "a[1]"
    here.mkdir()
    (here / "is[here].laz").touch()
    monkeypatch.chdir(here)
    assert driver.absolute(path) == expected.format(here=here, escaped=f"{tmp_path}/a[[]1]")


def test_workers_find_what_settings_name_in_the_folder_of_the_driver(tmp_path, monkeypatch):
    telling = tmp_path / "telling"
    telling.write_text("#!/bin/sh\npwd >&2\n")
    telling.chmod(0o755)
    monkeypatch.setenv("CHAINAGE_PROGRAM", str(telling))
    assert driver.compute("out", "ground", "0", [], str(tmp_path)) == (0, f"{tmp_path}\n")
    code, told = driver.compute("out", "ground", "0", [], str(tmp_path / "only on the host of the driver"))
    assert (code, told) == (0, f"{os.getcwd()}\n")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--workers", "0"], "argument --workers: 0 is not a whole number of at least 1"),
        (["--workers", "-1"], "argument --workers: -1 is not a whole number of at least 1"),
        (["--workers", "two"], "argument --workers: two is not a whole number of at least 1"),
        (["--workers", "1", "--wait", "-1"], "argument --wait: -1 is not a whole number of at least 0"),
        (["--workers", "1", "--memory", "0.5M"], "memory = '0.5M': must be from 16M to 16384G"),
        (["--workers", "1", "--threads", "3"], "--threads cannot be given: each worker"),
        (["--workers", "1", "--threads=3"], "--threads cannot be given: each worker"),
        (["--workers", "1", "--units"], "--units cannot be given: the run is always opened for workers"),
        (["--workers", "1", "--json=plan.json"], "--json cannot be given: the plan is read"),
    ],
)
def test_usage_errors_name_the_option(tmp_path, capsys, options, text):
    with pytest.raises(SystemExit) as ended:
        driver.main([str(SAMPLE), "-o", str(tmp_path / "out"), *options])
    told = capsys.readouterr().err
    assert ended.value.code == 2 and told.splitlines()[-1].startswith("python -m chainage.dask: error: ")
    assert text in told and "resumes" not in told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("given", "mib"), [("512", 512), ("512M", 512), ("4g", 4096)])
def test_memory_is_read_as_on_the_command_line(given, mib):
    args, further = driver.parsed(["a.laz", "-o", "out", "--workers", "1", "--memory", given, "--fresh"])
    assert (args.memory, further) == (mib, ["--fresh"])


def test_the_help_names_the_options_that_are_not_taken(capsys):
    with pytest.raises(SystemExit):
        driver.main(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "are those of chainage plan, such as --method or --set, but not --threads, --units, --json, --svg." in told


@pytest.mark.parametrize("exists", [False, True])
def test_a_refused_setting_does_not_promise_that_the_command_resumes(tmp_path, capfd, exists):
    out = tmp_path / "out"
    if exists:
        alone(out)
    assert driver.main([str(SAMPLE), "-o", str(out), "--workers", "1", "--set", "street.bla=3"]) == 3
    told = capfd.readouterr().err
    assert "there is no setting street.bla" in told and "resumes" not in told


def test_a_failed_run_promises_that_the_command_resumes(tmp_path, monkeypatch, capfd):
    broken = tmp_path / "broken"
    broken.write_text(f'#!/bin/sh\n[ "$1" = work ] && {{ echo "error: no" >&2; exit 7; }}\nexec {PROGRAM} "$@"\n')
    broken.chmod(0o755)
    monkeypatch.setenv("CHAINAGE_PROGRAM", str(broken))
    assert driver.main([str(SAMPLE), "-o", str(tmp_path / "out"), "--workers", "1", *OPTIONS]) == 7
    assert capfd.readouterr().err.endswith("error: no\nhint: the same command resumes; finished units are kept\n")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "bla://x", "tcp://127.0.0.1", ""])
def test_a_scheduler_that_cannot_be_reached_is_one_line(tmp_path, address):
    command = [sys.executable, "-m", "chainage.dask", SAMPLE, "-o", tmp_path / "out", "--scheduler", address]
    soon = {**os.environ, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s"}
    done = subprocess.run(command, capture_output=True, text=True, env=soon)
    assert done.returncode == 4
    assert re.fullmatch(f"error: no scheduler can be reached at '{address}': .*\n", done.stderr), done.stderr
