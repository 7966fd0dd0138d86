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
