"""Evaluations, reproductions and lots on a Ray cluster, shard by shard: ``pip install "lotpilot[ray]"``.

    import lotpilot.ray
    tables = lotpilot.ray.evaluate({"mine": my_policy, "expert": "expert"}, "test:1000", shards=64, out="runs/on-ray",
                                   address="auto")

A task drives one shard and hands back its files, which are written at once into ``OUT.shards/``: nodes need no file
system in common. A node that dies costs what it was driving; Ray begins those tasks elsewhere. Shards that are in
``OUT.shards/`` are not driven again by a later call with the same arguments. Functions are known by their names: if one is
pickled otherwise than before, a warning says so, and it is up to you whether it has changed. When all shards are there they
are merged into ``OUT``: the same rows and tables as ``lotpilot.evaluate`` writes on one machine, byte for byte.

Every node needs the same wheel of lotpilot, and the files that drivers and lots name under the same paths.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import ray
from ray import cloudpickle

from . import _native, tables
from .core import check_whole, names
from .tables import Driver, Evaluation, Table

__all__ = ["ShardError", "evaluate", "generate", "reproduce"]

Files = dict[str, bytes]
"""The content of files by their paths within a folder."""


class ShardError(RuntimeError):
    """Shards that could not be driven, with the first reason; the others are kept."""


def evaluate(
    drivers: Driver | Sequence[Driver] | Mapping[str, Driver],
    lots: str | Sequence[str] | None = None,
    *,
    shards: int,
    out: str | os.PathLike[str],
    address: str | None = None,
    cpus: int = 1,
    retries: int = 3,
    progress: bool = True,
    **options: Any,
) -> Evaluation:
    """Does what ``lotpilot.evaluate`` does, on a Ray cluster.

    Args:
        drivers: As there; functions are pickled, and called on the nodes.
        lots: As there.
        shards: How many tasks; several times as many as there are CPUs keep all of them busy to the end.
        out: Folder for the files of the evaluation. The shards are kept in ``OUT.shards/`` beside it.
        address: Of the cluster, as ``ray.init`` takes it; None uses the one in use, or starts one on this machine.
        cpus: CPUs of a task, and its threads.
        retries: How often a shard is begun again whose node or process died.
        progress: Whether to count finished shards on stderr.
        **options: The other keywords of ``lotpilot.evaluate``, except for ``overwrite``.

    Raises:
        ValueError: If a number is out of range.
        FileExistsError: If ``out`` is there, or ``OUT.shards/`` holds shards of other arguments.
        ShardError: If shards cannot be driven; what was driven is kept, the reasons are in ``OUT.shards/failures.txt``.
    """
    _check(shards, cpus, retries)
    request = tables.Request.of(drivers, lots, **options)
    out = Path(out)
    folder = _shards(out)
    if out.exists():
        raise FileExistsError(f"{out}: exists already; choose another folder, or delete it")
    _claim(folder, {"evaluate": request.described(), "shards": shards, "lotpilot": _digest()})
    _warn_of_other_functions(folder, request)
    parts = _parts(folder, shards)
    missing = {part: (request, f"{part.name}/{shards}") for part in parts if not part.exists()}
    _drive(_evaluate, missing, _keep, folder, len(parts), address, cpus, retries, progress)
    return request.merge(parts, out)


def reproduce(
    *arguments: str,
    shards: int,
    out: str | os.PathLike[str],
    program: str | os.PathLike[str] = "target/debug/xtask",
    address: str | None = None,
    cpus: int = 1,
    retries: int = 3,
    progress: bool = True,
) -> str:
    """Does what ``cargo xtask reproduce`` does, on a Ray cluster: its trainings first, then what all networks drive.

    Args:
        *arguments: Those of the command, except for ``--out``, ``--overwrite`` and ``--resume``: ``"--full"``. Files
            that they name are looked for on the nodes, from this working folder.
        shards: How many tasks there are of each half. A training is done by one task; more tasks than trainings have
            nothing to train.
        out: Folder of the run, below the working folder. Shards are kept in ``OUT.trained/`` and ``OUT.driven/``.
        program: What ``cargo xtask`` runs, as ``cargo build -p xtask`` makes it here; nodes are sent this file.
        address: As in ``evaluate``.
        cpus: As in ``evaluate``.
        retries: As in ``evaluate``.
        progress: As in ``evaluate``.

    Returns:
        What the command prints: what holds.

    Raises:
        ValueError: If a number is out of range, or ``out`` does not lie below the working folder.
        FileNotFoundError: If there is no ``program``.
        FileExistsError: If ``out`` is there and not what an earlier call left, or shards are there of other arguments.
        ShardError: As ``evaluate``.
    """
    _check(shards, cpus, retries)
    program, out = Path(program).resolve(), Path(os.path.relpath(out))
    if ".." in out.parts:
        raise ValueError(f"{out}: name a folder below the working folder, which nodes can have, too")
    # Only trainings that an earlier call merged: others would be taken for those of this one.
    if out.exists() and ((out / "finished.toml").exists() or not _is_claimed(_trained(out))):
        raise FileExistsError(f"{out}: exists already; choose another folder, or delete it")
    if not program.is_file():
        raise FileNotFoundError(f"{program}: is missing; make it with cargo build -p xtask")
    content = program.read_bytes()
    about = {"reproduce": arguments, "shards": shards, "program": hashlib.sha256(content).hexdigest()}

    def share(folder: Path, command: tuple[str, ...], read: Files) -> list[Path]:
        _claim(folder, about)
        parts = _parts(folder, shards)
        missing = [part for part in parts if not part.exists()]
        jobs = {part: (str(out), command, f"{part.name}/{shards}", cpus) for part in missing}
        _drive(_reproduce, jobs, _keep, folder, len(parts), address, cpus, retries, progress, (content, read))
        return parts

    trained = share(_trained(out), ("reproduce", *arguments), {})
    _call(program, "merge", *trained, "--out", out)
    # What drives reads networks, not what they were trained on.
    read = {str(out / name): file for name, file in _files(out).items() if not name.endswith((".npy", ".npz"))}
    driven = share(out.with_name(f"{out.name}.driven"), ("reproduce", "--networks", str(out)), read)
    return _call(program, "merge", *driven)


def generate(
    lots: str | Sequence[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    seed: int = 1,
    count: int = 1,
    address: str | None = None,
    cpus: int = 1,
    retries: int = 3,
    progress: bool = True,
) -> Table:
    """Draws lots as ``lotpilot.generate`` does, on a Ray cluster. Lots of the same name in ``out`` are replaced.

    Args:
        lots: As there.
        seed: As there.
        count: As there.
        shards: As in ``evaluate``.
        out: Folder for TOML and PNG files.
        address: As in ``evaluate``.
        cpus: As in ``evaluate``.
        retries: As in ``evaluate``.
        progress: As in ``evaluate``.

    Returns:
        Columns ``name``, ``path``, ``route_m`` and ``obstacles``, in the order of ``lotpilot.generate``.

    Raises:
        ValueError: If nothing is named so, a number is out of range, or a lot would replace another one or what it is
            made of.
        ShardError: As ``evaluate``.
    """
    _check(shards, cpus, retries)
    check_whole("seed", seed)
    check_whole("count", count, least=1, below=2**20)
    out = Path(out)
    single = _native.lots(names(lots, "lots"))
    _native.check_generate(single, seed, count, out)
    jobs = {f"{number}/{shards}": (single[number - 1 :: shards], seed, count) for number in range(1, shards + 1)}
    jobs = {number: job for number, job in jobs.items() if job[0]}
    drawn: dict[str, list[dict[str, Any]]] = {}

    def keep(_: str, answer: tuple[list[dict[str, Any]], Files]) -> None:
        rows, files = answer
        _write(out, files)
        for row in rows:
            drawn.setdefault(row.pop("lot"), []).append({**row, "path": str(out / row["path"])})

    # Beside ``out``, which is the caller's and may hold a file of any name.
    _drive(_generate, jobs, keep, _shards(out), len(jobs), address, cpus, retries, progress)
    rows = [row for lot in single for row in drawn[lot]]
    return {column: [row[column] for row in rows] for column in ("name", "path", "route_m", "obstacles")}


def _drive(
    work: Callable[..., Any],
    jobs: Mapping[Any, tuple[Any, ...]],
    keep: Callable[[Any, Any], None],
    folder: Path,
    of: int,
    address: str | None,
    cpus: int,
    retries: int,
    progress: bool,
    shared: Sequence[Any] = (),
) -> None:
    """Does each job as a task, its last arguments what all of them share, and keeps the answers as they come."""
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    # Of an earlier call.
    (folder / "failures.txt").unlink(missing_ok=True)
    task = ray.remote(_guarded(work.__name__, _digest())).options(
        num_cpus=cpus, max_retries=retries, runtime_env={"env_vars": _environment(cpus)}
    )
    # Sent once to every node.
    references = [ray.put(value) for value in shared]
    # Pickled here, so that a node without lotpilot can take them and say so.
    job_of = {
        task.remote(os.getcwd(), cloudpickle.dumps(arguments), *references): job for job, arguments in jobs.items()
    }
    pending, failed = list(job_of), []
    try:
        while pending:
            (ready,), pending = ray.wait(pending)
            # Whatever is still referred to stays in memory: a finished task's answer is all of its shard's files.
            job = job_of.pop(ready)
            try:
                answer = ray.get(ready)
            except ray.exceptions.RayError as error:
                answer = (str(error).strip() or repr(error)).splitlines()[-1]
            if isinstance(answer, str):
                failed.append(f"shard {getattr(job, 'name', job)}: {answer}")
                folder.mkdir(parents=True, exist_ok=True)
                with open(folder / "failures.txt", "a", encoding="utf-8") as file:
                    file.write(failed[-1] + "\n")
            else:
                keep(job, answer)
            if progress:
                done = of - len(pending) - len(failed)
                print(f"\r{done} of {of} shards, {len(failed)} failed", end="" if pending else "\n", file=sys.stderr)
    finally:
        # After Ctrl-C, or an answer that could not be kept: nobody waits for the others.
        for task_left in pending:
            ray.cancel(task_left)
    if failed:
        raise ShardError(f"{len(failed)} of {of} shards failed, the others are kept; {failed[0]}")


def _environment(cpus: int) -> dict[str, str]:
    """The environment of a task: as many threads as CPUs."""
    return {"RAYON_NUM_THREADS": str(cpus)}


def _guarded(name: str, digest: str) -> Callable[..., Any]:
    """A function of this module as a task: what it returns, or as text why there is nothing to return.

    Ray pickles it whole, because it is not part of a module; so a node without lotpilot can say so.
    """

    def task(folder: str, arguments: bytes, *shared: Any) -> Any:
        import os
        import pickle

        where = f"node {os.uname().nodename}"
        try:
            from lotpilot import ray as here
        except ImportError as error:
            return f"{where} has no lotpilot ({error}); install the same wheel on every node"
        if here._digest() != digest:
            return f"{where} has another lotpilot than the caller; install the same wheel on every node"
        try:
            if os.path.isdir(folder):
                os.chdir(folder)
            return getattr(here, name)(*pickle.loads(arguments), *shared)
        except Exception as error:
            return f"{type(error).__name__}: {error}"

    return task


def _reproduce(run: str, command: tuple[str, ...], shard: str, cpus: int, program: bytes, read: Files) -> Files:
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch:
        file, out, folder = Path(scratch, "xtask"), Path(scratch, "shard"), Path.cwd()
        file.write_bytes(program)
        file.chmod(0o755)
        if read:
            # The networks under the name that they have at the caller's, beside what the node has of that folder.
            beside = Path(scratch, "folder")
            _link(folder, beside, Path(run))
            _write(beside, read)
            folder = beside
        _call(file, "--quiet", "--threads", cpus, *command, "--shard", shard, "--out", out, folder=folder)
        return _files(out)


def _link(folder: Path, to: Path, but: Path) -> None:
    """Makes a folder with links to what is in another one, except for what lies at ``but`` there, which is empty."""
    to.mkdir()
    name, *rest = but.parts
    for entry in folder.iterdir() if folder.is_dir() else ():
        if entry.name != name:
            (to / entry.name).symlink_to(entry)
    if rest:
        _link(folder / name, to / name, Path(*rest))


def _call(program: Path, *arguments: object, folder: Path | None = None) -> str:
    """What a command prints; its last line on stderr as an error."""
    done = subprocess.run([program, *map(str, arguments)], cwd=folder, capture_output=True, encoding="utf-8")
    if done.returncode:
        raise ShardError((done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1])
    return done.stdout


def _check(shards: int, cpus: int, retries: int) -> None:
    check_whole("shards", shards, least=1, below=10**6)
    check_whole("cpus", cpus, least=1, below=1025)
    check_whole("retries", retries, below=10**6)


def _shards(out: Path) -> Path:
    return out.with_name(f"{out.name}.shards")


def _trained(out: Path) -> Path:
    return out.with_name(f"{out.name}.trained")


def _parts(folder: Path, shards: int) -> list[Path]:
    return [folder / str(number) for number in range(1, shards + 1)]


def _evaluate(request: tables.Request, shard: str) -> Files:
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch:
        out = Path(scratch, "shard")
        request.drive(out, shard=shard)
        return _files(out)


def _generate(lots: list[str], seed: int, count: int) -> tuple[list[dict[str, Any]], Files]:
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch:
        rows = []
        for lot in lots:
            drawn = tables.generate(lot, seed=seed, count=count, out=scratch)
            for name, path, route_m, obstacles in zip(
                *(drawn[column] for column in ("name", "path", "route_m", "obstacles")), strict=True
            ):
                rows.append(
                    {"lot": lot, "name": name, "path": Path(path).name, "route_m": route_m, "obstacles": obstacles}
                )
        return rows, _files(Path(scratch))


def _digest() -> str:
    """The digest of the native half, which tells one build of lotpilot from another."""
    file = _native.__file__
    assert file is not None
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _warn_of_other_functions(folder: Path, request: tables.Request) -> None:
    """Says so if shards are there of functions that were pickled differently: most have changed then. Not all, as what
    is pickled of one function may differ from process to process."""
    content = hashlib.sha256()
    for _, driver in request.drivers:
        if isinstance(driver, str):
            continue
        content.update(cloudpickle.dumps(driver))
        # Of what an installed module defines only the name is pickled.
        module = getattr(driver, "__module__", None)
        source = getattr(sys.modules.get(module or ""), "__file__", None)
        if source is not None and module != "__main__":
            content.update(Path(source).read_bytes())
    file = folder / _FUNCTIONS
    if _is_claimed(folder) and file.exists() and file.read_text(encoding="utf-8") != content.hexdigest():
        warnings.warn(
            f"{folder}: holds shards of functions pickled differently; if one has changed, delete the folder or "
            "choose another out",
            stacklevel=3,
        )
    # What the first shards were driven by: so shards of two functions are warned of each time.
    if not (_is_claimed(folder) and file.exists()):
        file.write_text(content.hexdigest(), encoding="utf-8")


_FUNCTIONS = "functions.sha256"
"""File with the digest of the functions that the first shards were driven by."""


def _claim(folder: Path, about: dict[str, Any]) -> None:
    """Refuses a folder with shards of something else."""
    folder.mkdir(parents=True, exist_ok=True)
    file, text = folder / _ABOUT, json.dumps(about, default=str)
    if not _is_claimed(folder):
        file.write_text(text, encoding="utf-8")
    elif file.read_text(encoding="utf-8") != text:
        raise FileExistsError(
            f"{folder}: holds shards of other arguments or another lotpilot; delete it, or choose another out"
        )


_ABOUT = "shards.json"
"""What shards are of, in the folder that they are kept in."""


def _is_claimed(folder: Path) -> bool:
    """Whether shards are kept there: before the first one, another call may have the folder."""
    return (folder / _ABOUT).exists() and any(path.name.isdigit() for path in folder.iterdir())


def _keep(shard: Path, files: Files) -> None:
    partial = shard.with_name(f"{shard.name}.lotpilot-partial")
    shutil.rmtree(partial, ignore_errors=True)
    _write(partial, files)
    # A folder under its own name is whole.
    partial.rename(shard)


def _files(folder: Path) -> Files:
    found = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in found}


def _write(folder: Path, files: Files) -> None:
    for name, content in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
