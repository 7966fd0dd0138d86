"""Drives of files: the bytes of the command line, events, Ctrl-C, exceptions by kind."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import INSTALLED, PROGRAM, SAMPLE

import chainage

SMALL = {"method": "euclidean", "ground": "voxel-column", "tile_length": 10}


def test_the_program_is_on_the_path():
    told = subprocess.run([INSTALLED, "--version"], check=True, capture_output=True, text=True).stdout
    assert told.split() == ["chainage", chainage.__version__]


def test_run_writes_the_bytes_of_the_command_line(tmp_path):
    seen = []
    summary = chainage.run(SAMPLE, tmp_path / "here", **SMALL, max_gap_m=0.4, progress=seen.append)
    options = ["--method", "euclidean", "--ground", "voxel-column", "--tile-length", "10", "--set", "euclidean.max_gap_m=0.4"]
    command = [PROGRAM, "run", SAMPLE, "-o", tmp_path / "there", "--progress", "none", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for name in (SAMPLE.name, "objects.csv", "objects.geojson"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes(), name
    assert summary["points"] == 71841 and summary["objects"] > 10 and summary["tiles"] > 5
    finished = [event for event in seen if event["event"] == "unit-finished" and event["pass"] == "ground"]
    assert len(finished) == summary["tiles"]
    assert chainage.status(tmp_path / "here")["finished"]
    assert chainage.run(SAMPLE, tmp_path / "here", **SMALL, max_gap_m=0.4)["nothing_to_do"]


def test_objects_are_the_rows_of_the_table(tmp_path):
    summary = chainage.run(SAMPLE, tmp_path / "out", **SMALL)
    table = chainage.objects(tmp_path / "out")
    assert len(table) == summary["objects"]
    ids = [row["id"] for row in table] if isinstance(table, list) else list(table["id"])
    assert ids == list(range(1, len(ids) + 1))


def readme_columns():
    readme = Path(__file__).resolve().parents[2].joinpath("README.md").read_text(encoding="utf-8")
    _, _, rest = readme.partition("<!-- columns of objects")
    rows = [line.split("|") for line in rest.partition("<!-- end of columns of objects")[0].splitlines() if line.startswith("| `")]
    return {row[1].strip(" `"): row[2].strip() for row in rows}


def test_a_frame_has_the_same_types_whatever_the_objects(tmp_path):
    pytest.importorskip("pandas")
    chainage.run(SAMPLE, tmp_path / "some", **SMALL)
    chainage.run(SAMPLE, tmp_path / "none", **SMALL, min_points=1_000_000)
    some, none = chainage.objects(tmp_path / "some"), chainage.objects(tmp_path / "none")
    assert len(some) > 10 and len(none) == 0
    assert type(none) is type(some) and list(none.columns) == list(some.columns)
    assert none.dtypes.equals(some.dtypes)
    assert none["height_m"].isna().sum() == 0
    # No object of this method has a class, so that a whole column is empty.
    assert some["dbh_m"].isna().all()
    expected = {"whole number": "int64", "number": "float64", "true or false": "bool"}
    columns = readme_columns()
    assert len(columns) > 30 and list(columns) == [name for name in some.columns if name != "geometry"]
    for name, kind in columns.items():
        assert some[name].dtype == expected.get(kind, some[name].dtype), name
    assert isinstance(some["uid"].iloc[0], str) and isinstance(some["touches"].iloc[0], list)


@pytest.mark.parametrize(
    ("member", "epsg"),
    [
        ('"crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::25832"}},', 25832),
        ('"crs":null,', None),
        ("", None),
    ],
)
@pytest.mark.parametrize("features", ["", '{"type":"Feature","geometry":null,"properties":{"id":1,"height_m":null}}'])
def test_the_frame_has_the_coordinate_system_of_the_file(tmp_path, member, epsg, features):
    pytest.importorskip("geopandas")
    text = f'{{"type":"FeatureCollection",\n{member}\n"features":[{features}]}}'
    (tmp_path / "objects.geojson").write_text(text)
    table = chainage.objects(tmp_path)
    assert (table.crs and table.crs.to_epsg()) == epsg
    assert table["height_m"].dtype == float and len(table) == bool(features)


def test_an_unknown_coordinate_system_is_told(tmp_path):
    pytest.importorskip("geopandas")
    name = "urn:ogc:def:crs:EPSG::99999"
    (tmp_path / "objects.geojson").write_text(
        f'{{"type":"FeatureCollection","crs":{{"type":"name","properties":{{"name":"{name}"}}}},"features":[]}}'
    )
    with pytest.warns(UserWarning, match=f"{name} is not known to pyproj"):
        assert chainage.objects(tmp_path).crs is None


@pytest.mark.parametrize(
    ("memory", "mib"),
    [("800M", 800), ("4g", 4096), ("0.5GiB", 512), ("64", 64), ("1e3mb", 1000), (64, 64), (np.int64(512), 512)],
)
def test_memory_is_read_as_on_the_command_line(memory, mib):
    assert chainage.plan(SAMPLE, memory=memory)["memory"] == mib << 20
    if isinstance(memory, str):
        command = [PROGRAM, "plan", SAMPLE, "--memory", memory, "--json"]
        told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        assert json.loads(told)["memory"] == mib << 20


@pytest.mark.parametrize("memory", ["0.5M", "4T", "1M", "lots", "-3G", "4 G", "", "99999999999999G", "1e999", "16777217"])
def test_memory_is_refused_as_on_the_command_line(memory):
    with pytest.raises(ValueError, match="^" + re.escape(f"memory = {memory!r}: must be ")):
        chainage.plan(SAMPLE, memory=memory)
    assert subprocess.run([PROGRAM, "plan", SAMPLE, "--memory", memory], capture_output=True).returncode == 2


@pytest.mark.parametrize("memory", [0, 15, -5, 0.5, 1e3, True, [64]])
def test_other_memory_is_refused(memory):
    with pytest.raises(ValueError, match="^" + re.escape(f"memory = {memory!r}: must be ")):
        chainage.plan(SAMPLE, memory=memory)


def test_plan_writes_nothing(tmp_path):
    before = sorted(os.listdir(tmp_path))
    facts = chainage.plan([SAMPLE], memory="256M", threads=2, tile_length=20)
    assert facts["points"] == 71841 and len(facts["tiles"]) > 2 and facts["memory"] == 256 << 20
    assert sorted(os.listdir(tmp_path)) == before


def test_failures_are_exceptions_of_their_kind(tmp_path):
    with pytest.raises(chainage.InputError, match="none.laz") as found:
        chainage.run(tmp_path / "none.laz", tmp_path / "out")
    assert isinstance(found.value, OSError) and found.value.exit_code == 4
    with pytest.raises(chainage.SettingError, match="did you mean|euclidean.max_gap_m") as found:
        chainage.run(SAMPLE, tmp_path / "out", euclidian__max_gap_m=0.4)
    assert isinstance(found.value, ValueError) and found.value.hint
    with pytest.raises(chainage.StateError, match="contains no run"):
        chainage.status(tmp_path)
    with pytest.raises(ValueError, match="memory = 'lots'"):
        chainage.plan(SAMPLE, memory="lots")
    with pytest.raises(ValueError, match="max_gap_m = 0.4: needs its section"):
        chainage.plan(SAMPLE, max_gap_m=0.4)
    chainage.run(SAMPLE, tmp_path / "out", **SMALL)
    with pytest.raises(chainage.StateError, match="other input"):
        chainage.run(SAMPLE.with_name("mls_profiles.las"), tmp_path / "out", **SMALL)
    import fcntl

    with (tmp_path / "out/.chainage/lock").open("r+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(chainage.LockedError, match="in use by process") as found:
            chainage.run(SAMPLE, tmp_path / "out", **SMALL)
        assert found.value.exit_code == 7


def test_an_exception_in_progress_stops_the_run_and_it_resumes(tmp_path):
    def stop(event):
        if event["event"] == "unit-finished" and event["pass"] == "ground":
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        chainage.run(SAMPLE, tmp_path / "out", **SMALL, threads=1, progress=stop)
    assert not chainage.status(tmp_path / "out")["finished"]
    chainage.run(SAMPLE, tmp_path / "out", **SMALL)
    assert chainage.status(tmp_path / "out")["finished"]


def test_ctrl_c_stops_the_run(tmp_path):
    # A shell ignores the signal in what it starts in the background, and Python then installs no handler.
    text = (
        "import chainage, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "def told(event):\n"
        "    if event['event'] == 'unit-finished': print('unit', flush=True)\n"
        "try:\n"
        "    chainage.run(sys.argv[1], sys.argv[2], method='euclidean', tile_length=1, tiling__cell=0.5, threads=1, progress=told)\n"
        "except KeyboardInterrupt:\n"
        "    print('stopped', flush=True)\n"
    )
    command = [sys.executable, "-c", text, str(SAMPLE), str(tmp_path / "out")]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "unit\n"
    child.send_signal(signal.SIGINT)
    rest, _ = child.communicate(timeout=60)
    assert child.returncode == 0 and rest.splitlines()[-1] == "stopped"
    assert not chainage.status(tmp_path / "out")["finished"]


def test_other_threads_of_python_go_on_meanwhile(tmp_path):
    ticks = []
    over = threading.Event()

    def tick():
        while not over.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.monotonic()
    chainage.segment([[x * 0.01, y * 0.01, 0.0] for x in range(150) for y in range(150)], method="euclidean")
    lasted = time.monotonic() - began
    over.set()
    thread.join()
    during = [b - a for a, b in zip(ticks, ticks[1:], strict=False)]
    assert max(during) < max(0.25, lasted / 2), f"the interpreter was held for {max(during):.2f} of {lasted:.2f} s"
