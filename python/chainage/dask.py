"""Process a drive on dask.distributed: ``python -m chainage.dask FILES -o OUT --workers N | --scheduler ADDRESS``.

Dask starts the program ``chainage work`` for batches of units on its workers. The driver, this process, opens the run,
completes each pass and hands out the next. Only numbers of units and texts travel through Dask.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

# A unit that fails so often fails for good.
MOST_TRIES = 3
# Batches per worker and pass. Chosen: few enough that starting the program is cheap, enough that no worker waits long.
BATCHES_PER_WORKER = 4
# Exit codes of the program after which another try cannot help: usage, configuration, state, locked.
FINAL = {2, 3, 6, 7}
INTERRUPTED = 130


class Ended(Exception):
    """The run cannot go on: an exit code and a text."""

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


def compute(out: str, name: str, units: str, options: Sequence[str]) -> tuple[int, str]:
    """Compute units in a process of its own, on a worker of Dask. Returns its exit code and what it said."""
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
    done = subprocess.run(command, stdin=nothing, stdout=nothing, stderr=subprocess.PIPE, text=True)
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
        future = client.submit(compute, out, name, batch, list(options), pure=False, retries=MOST_TRIES)
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
        say(f"{name}: units {batch} failed with {code}, they are tried again")
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
    """Free memory of this host in MiB."""
    return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 20


def parsed(arguments: Sequence[str] | None) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(
        prog="python -m chainage.dask",
        description="Process a drive on dask.distributed. Further options are those of chainage plan.",
    )
    parser.add_argument("files", nargs="+", help="LAS or LAZ files, folders, or patterns, as all workers reach them")
    parser.add_argument("-o", "--out", required=True, help="output directory, as all workers reach it")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--workers", type=int, metavar="N", help="start N worker processes on this host")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use the workers of a scheduler, such as tcp://host:8786")
    memory = "memory of one worker in MiB [default: half of the free memory of this host, divided by the workers]"
    parser.add_argument("--memory", type=int, metavar="MIB", help=memory)
    wait = "look for files that other hosts have just written for so long [default: 60]"
    parser.add_argument("--wait", type=int, default=60, metavar="SECONDS", help=wait)
    parser.add_argument("-q", "--quiet", action="store_true", help="show failures only")
    return parser.parse_known_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    args, further = parsed(arguments)
    try:
        import dask
        from distributed import Client
    except ImportError:
        print("error: dask.distributed is not installed\nhint: pip install 'chainage[dask]'", file=sys.stderr)
        return 2
    say = (lambda text: None) if args.quiet else (lambda text: print(text, file=sys.stderr, flush=True))
    # A task whose worker is killed is not to blame for it until the worker was killed often.
    dask.config.set({"distributed.scheduler.allowed-failures": 10})
    cluster = None
    try:
        if args.workers:
            cluster = local_cluster(args.workers)
        with Client(cluster or args.scheduler, set_as_default=False) as client:
            workers = args.workers or max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
            memory = args.memory or max(16, free_mebibytes() // 2 // workers)
            # The plan sees one machine with all workers: tiles fit the memory of each.
            plan = ["--threads", str(workers), "--memory", f"{memory * workers}M", *further]
            options = ["--threads", "1", "--memory", f"{memory}M", "--wait", str(args.wait)]
            drive(client, args.files, args.out, plan, options, say)
        return 0
    except Ended as ended:
        print(f"{ended}\nhint: the same command resumes; finished units are kept", file=sys.stderr)
        return ended.code
    except KeyboardInterrupt:
        print("interrupted: the same command resumes", file=sys.stderr)
        return INTERRUPTED
    finally:
        if cluster is not None:
            cluster.close()


if __name__ == "__main__":
    sys.exit(main())
