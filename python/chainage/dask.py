"""Process a drive on dask.distributed: ``python -m chainage.dask FILES -o OUT --workers N | --scheduler ADDRESS``.

Dask starts the program ``chainage work`` for batches of units on its workers. The driver, this process, opens the run,
completes each pass and distributes the next. Only numbers of units and texts travel through Dask.
"""

from __future__ import annotations

import argparse
import glob
import json
import logging
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from chainage.settings import mebibytes

# After this many failures of a unit, the run ends.
MOST_TRIES = 3
# Batches per worker and pass. Chosen: few enough that starting the program is cheap, enough that no worker waits long.
BATCHES_PER_WORKER = 4
# Exit codes of the program after which another try cannot help: usage, configuration, state, locked.
FINAL = {2, 3, 6, 7}
LOCKED = 7
NO_SCHEDULER = 4
INTERRUPTED = 130
# Options of chainage plan that cannot be given, and why.
REFUSED = {
    "--threads": "each worker computes one unit at a time, and --workers or the scheduler says how many there are",
    "--units": "the run is always opened for workers",
    "--json": "the plan is read by this driver and not shown",
    "--svg": "no plan is drawn while a run is opened: call chainage plan without -o",
}


class Ended(Exception):
    """The run cannot continue: an exit code and a message."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def program() -> str:
    """The program: CHAINAGE_PROGRAM, the one beside this interpreter, or the one on the PATH."""
    beside = Path(sys.executable).with_name("chainage")
    found = os.environ.get("CHAINAGE_PROGRAM") or (str(beside) if beside.exists() else shutil.which("chainage"))
    if not found:
        raise Ended(1, "the program chainage is neither beside the interpreter nor on the PATH")
    return found


def compute(out: str, name: str, units: str, options: Sequence[str], folder: str) -> tuple[int, str]:
    """Compute units in a process of its own, on a worker of Dask. Returns its exit code and its standard error.

    Settings may name files relative to `folder`, the working directory of the driver.
    """
    # Sent to workers by value: it must not need anything of this module that is not imported here.
    import os
    import shutil
    import subprocess
    import sys
    from pathlib import Path

    beside = Path(sys.executable).with_name("chainage")
    path = os.environ.get("CHAINAGE_PROGRAM") or (str(beside) if beside.exists() else shutil.which("chainage"))
    if not path:
        return 2, "error: the program chainage is not installed on this worker"
    command = [path, "work", out, "--pass", name, "--units", units, *options]
    nothing = subprocess.DEVNULL
    here = folder if os.path.isdir(folder) else None
    done = subprocess.run(command, stdin=nothing, stdout=nothing, stderr=subprocess.PIPE, text=True, cwd=here)
    return done.returncode, done.stderr


def call(*arguments: str) -> dict:
    """Call the program here, and read the JSON that it prints."""
    command = [program(), *arguments, "--json"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise Ended(done.returncode, f"chainage {arguments[0]} ended with {done.returncode}")
    return json.loads(done.stdout)


def batches(units: Sequence[int], parts: int) -> list[str]:
    """Units divided into parts of neighbours, in the form that ``work --units`` takes."""
    parts = max(1, min(parts, len(units)))
    ends = [len(units) * part // parts for part in range(parts + 1)]
    return [",".join(map(str, units[a:b])) for a, b in zip(ends, ends[1:], strict=False)]


def compute_pass(client, out: str, due: dict, options: Sequence[str], say) -> None:
    """Compute the units of a pass on the workers. A batch whose worker was killed, or that failed, is tried again."""
    from distributed import as_completed

    name, total = due["pass"], len(due["units"])
    workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    tries: dict[str, int] = {}
    began = time.monotonic()

    def submit(batch: str):
        tries[batch] = tries.get(batch, 0) + 1
        # Not pure: the same batch is computed again after a failure. Dask itself repeats what a killed worker did.
        future = client.submit(
            compute, out, name, batch, list(options), os.getcwd(), pure=False, retries=MOST_TRIES
        )
        futures[future.key] = batch
        return future

    futures: dict[str, str] = {}
    first = [submit(batch) for batch in batches(due["units"], workers * BATCHES_PER_WORKER)]
    running = as_completed(first, loop=client.loop)
    done = 0
    for future in running:
        batch = futures.pop(future.key)
        try:
            code, text = future.result()
        except Exception as error:  # killed workers, lost connections: Dask names them in many ways
            code, text = -1, f"{type(error).__name__}: {error}"
        if code == 0:
            done += len(batch.split(","))
            say(f"{name}: {done} of {total} units, {time.monotonic() - began:.1f} s")
            continue
        if code in FINAL:
            raise Ended(code, text.strip())
        if tries[batch] >= MOST_TRIES:
            failed = f"units {batch} of pass {name} failed {MOST_TRIES} times, the last time:\n{text.strip()}"
            raise Ended(max(code, 1), failed)
        say(f"{name}: units {batch} failed with {code} and are tried again")
        running.add(submit(batch))


def drive(client, files: Sequence[str], out: str, plan: Sequence[str], options: Sequence[str], say) -> None:
    """Process a drive: open the run, and compute pass after pass until every output is complete."""
    due = call("plan", *files, "-o", out, "--units", *plan)
    while due["pass"] is not None:
        if due["units"]:
            compute_pass(client, out, due, options, say)
        due = call("reduce", out, "--after", due["pass"])
    say(f"finished: {out}")


def local_cluster(workers: int):
    """Start worker processes on this host. No other host can connect. Memory is counted by the program, not by Dask."""
    from distributed import LocalCluster

    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    )


def free_mebibytes() -> int:
    """Available memory of this host in MiB: free memory, and the page cache that the system gives back."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            for line in lines:
                name, _, value = line.partition(":")
                if name == "MemAvailable":
                    return int(value.split()[0]) >> 10
    except OSError:
        pass  # not Linux
    return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 20


def absolute(path: str) -> str:
    """A path, or a pattern, that means the same in every working directory."""
    # No path at all is left for the program to refuse.
    if not path or os.path.isabs(path):
        return path
    # As the program does, a path that exists is not taken as a pattern.
    is_pattern = glob.has_magic(path) and not os.path.exists(path)
    return os.path.join(glob.escape(os.getcwd()) if is_pattern else os.getcwd(), path)


def at_least(least: int) -> Callable[[str], int]:
    """The reader of an option that takes a whole number from `least` on."""

    def read(text: str) -> int:
        if not re.fullmatch("[0-9]+", text) or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text} is not a whole number of at least {least}")
        return int(text)

    return read


def size(text: str) -> int:
    """The reader of an option that takes a size in memory."""
    try:
        return mebibytes(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parsed(arguments: Sequence[str] | None) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(
        prog="python -m chainage.dask",
        description="Process a drive on dask.distributed. Further options, after FILES, are those of chainage plan, such as --method "
        f"or --set, but not {', '.join(REFUSED)}.",
        allow_abbrev=False,
    )
    files = "LAS or LAZ files, folders, or patterns, as all workers reach them"
    parser.add_argument("files", nargs="+", metavar="FILES", help=files)
    parser.add_argument("-o", "--out", required=True, help="output directory, as all workers reach it")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--workers", type=at_least(1), metavar="N", help="start N worker processes on this host")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use the workers of a scheduler, such as tcp://host:8786")
    memory = (
        "memory of one worker, for example 800M or 4G, or a number of MiB "
        "[default: half of the free memory of this host, divided by the workers]"
    )
    parser.add_argument("--memory", type=size, metavar="SIZE", help=memory)
    wait = "wait this long for files that other hosts have just written [default: 60]"
    parser.add_argument("--wait", type=at_least(0), default=60, metavar="SECONDS", help=wait)
    parser.add_argument("-q", "--quiet", action="store_true", help="show failures only")
    args, further = parser.parse_known_args(arguments)
    for option in (text.partition("=")[0] for text in further):
        if option in REFUSED:
            parser.error(f"{option} cannot be given: {REFUSED[option]}")
    args.files = [absolute(path) for path in args.files]
    args.out = absolute(args.out)
    return args, further


def connected(address):
    """The client of a cluster, or of the scheduler at an address."""
    from distributed import Client
    from distributed.comm import get_address_host

    try:
        if isinstance(address, str):
            # A client that has begun to connect to an invalid address prints more than one line.
            get_address_host(address)
        return Client(address, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Ended(NO_SCHEDULER, f"error: no scheduler can be reached at {address!r}: {error}") from None


def resumes(code: int, out: str) -> bool:
    """Whether the same command resumes the run in `out` after it has ended with this exit code."""
    return (code == LOCKED or code not in FINAL) and Path(out, ".chainage").is_dir()


def main(arguments: Sequence[str] | None = None) -> int:
    args, further = parsed(arguments)
    try:
        import dask
        import distributed  # noqa: F401  (functions above need it)
    except ImportError:
        print("error: dask.distributed is not installed\nhint: pip install 'chainage[dask]'", file=sys.stderr)
        return 2
    say = (lambda text: None) if args.quiet else (lambda text: print(text, file=sys.stderr, flush=True))
    # A task whose worker is killed is not to blame for it until the worker was killed often.
    dask.config.set({"distributed.scheduler.allowed-failures": 10})
    cluster = None
    try:
        if args.workers is not None:
            cluster = local_cluster(args.workers)
        with connected(cluster or args.scheduler) as client:
            workers = args.workers or max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
            memory = args.memory or max(16, free_mebibytes() // 2 // workers)
            # The plan sees one machine with all workers: tiles fit the memory of each.
            plan = ["--threads", str(workers), "--memory", f"{memory * workers}M", *further]
            options = ["--threads", "1", "--memory", f"{memory}M", "--wait", str(args.wait)]
            drive(client, args.files, args.out, plan, options, say)
        return 0
    except Ended as ended:
        code, text = ended.code, str(ended)
    except KeyboardInterrupt:
        code, text = INTERRUPTED, "interrupted"
    finally:
        if cluster is not None:
            cluster.close()
    print(text, file=sys.stderr)
    if resumes(code, args.out):
        print("hint: the same command resumes; finished units are kept", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
