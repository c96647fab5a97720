"""Evaluations and lots on a Ray cluster: the command line's shards as tasks.

    import lotpilot.ray
    lotpilot.ray.evaluate(["--driver", "run:runs/mine", "--lots", "test:1000"], shards=64, out="runs/on-ray",
                          address="auto")

A task drives one shard with the program ``xtask`` and hands back its files, which are written at once into ``OUT.shards/``;
no file system has to be shared for that. A node that dies costs what it was driving: Ray starts its tasks elsewhere. What is in
``OUT.shards/`` is not driven again by a later call with the same arguments. When all shards are there, ``xtask merge``
puts them together: the same bytes as one machine writes.

Every node needs the program, built from the same revision, and the files that the arguments name, under the same paths.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import ray

__all__ = ["ShardError", "evaluate", "generate"]


class ShardError(RuntimeError):
    """A shard that cannot be driven, with what the program said. Trying again would not help."""


class _Killed(RuntimeError):
    """The program was killed, for its memory perhaps: another attempt may succeed."""


def evaluate(
    arguments: Sequence[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    address: str | None = None,
    program: str | os.PathLike[str] | None = None,
    cpus: int = 1,
    retries: int = 3,
    progress: bool = True,
) -> Path:
    """Drives an evaluation on a Ray cluster and returns its folder.

    arguments: those of ``cargo xtask evaluate``, without ``--out``, ``--shard`` and ``--resume``.
    shards: how many tasks; several times as many as there are CPUs keep all of them busy to the end.
    out: folder of the evaluation. It must not exist; the shards are kept in ``OUT.shards/`` beside it.
    address: of the cluster, as ``ray.init`` takes it; ``None`` starts one on this machine, or uses the one in use.
    program: path of ``xtask`` on every node; ``None``: ``$LOTPILOT_PROGRAM``, or ``target/debug/xtask``.
    cpus: CPUs, and so threads, of a task.
    retries: how often a shard is begun again whose node or process died.
    progress: whether to count finished shards on stderr.

    Raises ValueError if an argument is not possible, FileExistsError if ``out`` is there, or shards of other arguments are,
    and ShardError with the message of the program if a shard or the merge fails; what was driven by then is kept.
    """
    out, folder, program = _places(out, program)
    if out.exists():
        raise FileExistsError(f"{out}: exists already; choose another folder, or delete it")
    _refuse(arguments, ("--out", "--overwrite", "--shard", "--resume", "--record"))
    command = ["evaluate", *arguments]

    def keep(number: int, files: dict[str, bytes]) -> None:
        shard = folder / str(number)
        partial = shard.with_name(f"{number}.partial")
        shutil.rmtree(partial, ignore_errors=True)
        _write(partial, files)
        # A folder under its own name is whole.
        shutil.rmtree(shard, ignore_errors=True)
        partial.rename(shard)

    _check_same(folder, command, shards)
    missing = [number for number in range(1, shards + 1) if not (folder / str(number) / "finished.toml").exists()]
    _drive(program, command, missing, shards, keep, folder, address, cpus, retries, progress)
    parts = [str(folder / str(number)) for number in range(1, shards + 1)]
    merged = subprocess.run([program, "--quiet", "merge", *parts, "--out", str(out)], capture_output=True, text=True)
    if merged.returncode != 0:
        raise ShardError(_said(merged.stderr))
    return out


def generate(
    arguments: Sequence[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    address: str | None = None,
    program: str | os.PathLike[str] | None = None,
    cpus: int = 1,
    retries: int = 3,
    progress: bool = True,
) -> Path:
    """Writes lots, as ``cargo xtask generate`` does, with tasks on a Ray cluster, and returns their folder.

    Files of the same name in ``out`` are replaced. Arguments and errors are those of :func:`evaluate`.
    """
    out, folder, program = _places(out, program)
    _refuse(arguments, ("--out", "--overwrite", "--shard"))
    _drive(program, ["generate", *arguments], list(range(1, shards + 1)), shards, lambda _, files: _write(out, files),
           folder, address, cpus, retries, progress)
    return out


def _places(out: str | os.PathLike[str], program: str | os.PathLike[str] | None) -> tuple[Path, Path, str]:
    out = Path(out).absolute()
    program = Path(program or os.environ.get("LOTPILOT_PROGRAM") or "target/debug/xtask").absolute()
    return out, out.with_name(out.name + ".shards"), str(program)


def _refuse(arguments: Sequence[str], flags: Sequence[str]) -> None:
    for argument in arguments:
        if argument.split("=")[0] in flags:
            raise ValueError(f"{argument} is not for shards; leave it out")


def _check_same(folder: Path, command: list[str], shards: int) -> None:
    """Refuses a folder with the shards of another evaluation."""
    folder.mkdir(parents=True, exist_ok=True)
    about, file = {"command": command, "shards": shards}, folder / "shards.json"
    if not file.exists():
        file.write_text(json.dumps(about), encoding="utf-8")
    elif json.loads(file.read_text(encoding="utf-8")) != about:
        raise FileExistsError(f"{folder}: holds shards of other arguments; delete it, or choose another out")


def _drive(
    program: str,
    command: list[str],
    numbers: list[int],
    of: int,
    keep: Callable[[int, dict[str, bytes]], None],
    folder: Path,
    address: str | None,
    cpus: int,
    retries: int,
    progress: bool,
) -> None:
    """Runs the shards as tasks and keeps the files of each as it comes."""
    if of < 1 or cpus < 1 or retries < 0:
        raise ValueError("shards and cpus are 1 or more, retries 0 or more")
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    task = ray.remote(_shard).options(num_cpus=cpus, max_retries=retries, retry_exceptions=[_Killed])
    number_of = {task.remote(program, command, f"{number}/{of}", cpus, os.getcwd()): number for number in numbers}
    pending, failed = list(number_of), []
    while pending:
        (ready,), pending = ray.wait(pending)
        number = number_of[ready]
        try:
            keep(number, ray.get(ready))
        except (ShardError, _Killed, ray.exceptions.RayError) as error:
            error = getattr(error, "cause", None) or error
            failed.append(f"shard {number}/{of}: {error}")
            folder.mkdir(parents=True, exist_ok=True)
            with open(folder / "failures.txt", "a", encoding="utf-8") as file:
                file.write(failed[-1] + "\n")
        if progress:
            done = of - len(pending) - len(failed)
            print(f"\r{done} of {of} shards, {len(failed)} failed", end="" if pending else "\n", file=sys.stderr)
    if failed:
        raise ShardError(f"{len(failed)} of {of} shards failed, the others are kept; {failed[0]}")


def _shard(program: str, command: list[str], shard: str, threads: int, folder: str) -> dict[str, bytes]:
    """The files that a shard comes to, by name. Runs on any node."""
    if not Path(program).is_file():
        raise ShardError(f"{program}: there is no such program on {os.uname().nodename}; build it there, or set program")
    with tempfile.TemporaryDirectory(prefix="lotpilot-") as scratch:
        out = Path(scratch) / "shard"
        line = [program, "--quiet", "--threads", str(threads), *command, "--shard", shard, "--out", str(out)]
        ran = subprocess.run(line, cwd=folder, capture_output=True, text=True)
        if ran.returncode < 0:
            raise _Killed(f"the program was ended by signal {-ran.returncode}")
        if ran.returncode != 0:
            raise ShardError(_said(ran.stderr))
        return {str(file.relative_to(out)): file.read_bytes() for file in sorted(out.rglob("*")) if file.is_file()}


def _write(folder: Path, files: dict[str, bytes]) -> None:
    for name, content in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def _said(stderr: str) -> str:
    """What the program gave as its error."""
    lines = [line for line in stderr.splitlines() if line.startswith("error: ")]
    return (lines[-1] if lines else stderr.strip()[-1000:]).removeprefix("error: ")
