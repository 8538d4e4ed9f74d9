"""Draws random mutations of the packages and says which of them the nearest tests notice.

    python -m tests.mutants --count 60 --seed 1

See docs/results/mutants.md for what came of it.
"""

from __future__ import annotations

import argparse
import json
import queue
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.mutants.covering import Covering
from tests.mutants.mutations import AREAS, Mutation, draw
from tests.mutants.nearest import Nearest
from tests.mutants.trial import Copy, Verdict

ROOT = Path(__file__).resolve().parents[2]
_AT_LENGTH = 2


def main() -> int:
    """Try mutations, print each verdict, the survivors with their lines and the score by area."""
    options = _options()
    mutations = _survivors_of(options.again) if options.again else draw(ROOT, options.count, options.seed)
    mutations = [mutation for mutation in mutations if mutation.path.startswith(options.only)]
    verdicts = []
    covering = Covering(ROOT, options.coverage) if options.coverage else None
    for verdict in tried(mutations, options.processes, Choice(Nearest(ROOT), covering, options.files), options.limit):
        verdicts.append(verdict)
        print(f"{len(verdicts):4d}/{len(mutations)} {_line(verdict)}", flush=True)
        if options.out:
            _store(options.out, verdicts)
    print("\nSurvivors")
    for verdict in verdicts:
        if not verdict.dead:
            print(f"{_line(verdict)}\n{verdict.mutation.diff}")
    print("\n".join(_score(verdicts)))
    return 0


@dataclass(frozen=True)
class Choice:
    """The tests that a mutation has to survive: those known to run its lines, otherwise those near its file."""

    nearest: Nearest
    covering: Covering | None
    files: int

    def tests(self, mutation: Mutation) -> list[str]:
        """Tests or whole files, the nearest first."""
        files = self.nearest.tests(mutation.path)
        if self.nearest.at_import(mutation.path, mutation.line):
            return [*self.nearest.walkers, *self._users(mutation.path, files)]
        lines = range(mutation.line, mutation.line + mutation.before.count("\n"))
        found = [self.covering.tests(mutation.path, line, files) for line in lines] if self.covering else []
        return next(filter(None, found), []) or self._users(mutation.path, files)

    def _users(self, path: str, files: list[str]) -> list[str]:
        """For lines run at an import or in another process: tests that run others of the file, then the nearest files.

        Coverage tells of a line run at an import only which test happened to import its module first.

        A process is run by whole sessions and wires: two of those are among the nearest.
        """
        users = self.covering.users(path, files) if self.covering else []
        asked = {test.partition("::")[0] for test in users}
        at_length = [file for file in files if not file.startswith("tests/unit/")]
        near = dict.fromkeys([*files[: self.files], *at_length[: _AT_LENGTH if self.covering else 0]])
        return [*users, *(file for file in near if file not in asked)]


def tried(mutations: list[Mutation], processes: int, choice: Choice, limit_s: float) -> Iterator[Verdict]:
    """Verdicts as they come, from as many copies of the tree as there are processes."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(processes) as threads:
        copies: queue.Queue[Copy] = queue.Queue()
        for number in range(processes):
            copies.put(Copy(ROOT, Path(folder) / str(number)))

        def verdict(mutation: Mutation) -> Verdict:
            copy = copies.get()
            try:
                return copy.verdict(mutation, choice.tests(mutation), limit_s)
            finally:
                copies.put(copy)

        for done in as_completed([threads.submit(verdict, mutation) for mutation in mutations]):
            yield done.result()
        while not copies.empty():
            copies.get().close()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=60, help="mutations to draw, evenly over the areas")
    parser.add_argument("--seed", type=int, default=1, help="which mutations are drawn")
    parser.add_argument("--processes", type=int, default=1, help="mutations tried at the same time")
    parser.add_argument("--files", type=int, default=4, help="nearest test files, for lines no test is known to run")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds of processor time for the tests of one mutation"
    )
    parser.add_argument(
        "--coverage", type=Path, help="what `make coverage` left (.coverage): ask just the tests that run the lines"
    )
    parser.add_argument("--only", default="", help="only files whose path begins with this")
    parser.add_argument("--out", type=Path, help="JSON file that keeps the verdicts")
    parser.add_argument("--again", type=Path, help="try the survivors kept in this file instead of drawing")
    return parser.parse_args()


def _survivors_of(file: Path) -> list[Mutation]:
    kept = [Mutation(**entry["mutation"]) for entry in json.loads(file.read_text()) if entry["outcome"] == "survived"]
    there = [mutation for mutation in kept if _still_there(mutation)]
    for mutation in set(kept) - set(there):
        print(f"gone since: {mutation.path}:{mutation.line}", file=sys.stderr)
    return there


def _still_there(mutation: Mutation) -> bool:
    file = ROOT / mutation.path
    return file.is_file() and mutation.before in file.read_text(encoding="utf-8")


def _store(file: Path, verdicts: list[Verdict]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps([asdict(verdict) for verdict in verdicts], indent=1), encoding="utf-8")


def _line(verdict: Verdict) -> str:
    mutation = verdict.mutation
    told = verdict.by or f"{verdict.tests} tests"
    return f"{verdict.outcome:8} {mutation.path}:{mutation.line} ({mutation.kind}) {told}, {verdict.seconds:.0f} s"


def _score(verdicts: list[Verdict]) -> Iterator[str]:
    yield f"{'':12} tried  killed  timeout  survived  dead"
    for area in [*AREAS, "all"]:
        of_area = [verdict for verdict in verdicts if area in (verdict.mutation.area, "all")]
        if of_area:
            killed, ended, left = (
                sum(v.outcome == name for v in of_area) for name in ("killed", "timeout", "survived")
            )
            share = 100 * (killed + ended) / len(of_area)
            yield f"{area:12} {len(of_area):5d}  {killed:6d}  {ended:7d}  {left:8d}  {share:3.0f} %"


if __name__ == "__main__":
    sys.exit(main())
