"""Single mutations of a source file: which there are, and the file with one of them changed."""

from __future__ import annotations

import ast
import random
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

AREAS = {
    "tracking": "tactile_lab/slam/tracking",
    "shape": "tactile_lab/slam/shape",
    "drivers": "drivers",
    "calibration": "calibration",
    "sessions": "sessions",
    "evaluation": "tactile_lab/evaluation",
}
COMPARED: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
COMPUTED: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
SWAPPED = {"min": "max", "minimum": "maximum", "argmin": "argmax", "any": "all", "floor": "ceil", "nanmin": "nanmax"}
SWAPPED |= {other: name for name, other in SWAPPED.items()}
UNIT_FACTORS = {1000, 1e-3, 1e6, 1e-6, 1e9, 1e-9}
# What may stand beside an operator between its operands.
BESIDE = r"[\s()\\]*"


@dataclass(frozen=True)
class Mutation:
    """Whole lines of a file, from ``line`` on (the first is 1), and what stands there instead."""

    path: str
    line: int
    kind: str
    before: str
    after: str

    @property
    def area(self) -> str:
        """Which of the areas its file belongs to."""
        return next(area for area, folder in AREAS.items() if self.path.startswith(folder + "/"))

    def applied(self, source: str) -> str:
        """The mutated file. Where lines have moved since it was drawn, the nearest equal ones change.

        :raises ValueError: if the lines are no longer there.
        """
        lines, wanted = source.splitlines(keepends=True), self.before.splitlines(keepends=True)
        places = [at for at in range(len(lines)) if lines[at : at + len(wanted)] == wanted]
        if not places:
            raise ValueError(f"{self.path} has no such lines any more: {self.before!r}")
        at = min(places, key=lambda place: abs(place + 1 - self.line))
        return "".join(lines[:at]) + self.after + "".join(lines[at + len(wanted) :])

    @property
    def diff(self) -> str:
        """Its lines before and after, as a patch shows them."""
        return "".join(
            f"    {sign} {line.rstrip()}\n"
            for sign, text in (("-", self.before), ("+", self.after))
            for line in text.splitlines()
        )


def draw(root: Path, count: int, seed: int) -> list[Mutation]:
    """Random mutations, as many in each area. A line is drawn first, and not again, then one of its mutations."""
    chance = random.Random(seed)
    lines = {area: _by_line(root, folder) for area, folder in AREAS.items()}
    drawn: list[Mutation] = []
    while len(drawn) < count:
        places = lines[list(AREAS)[len(drawn) % len(AREAS)]]
        mutations = places.pop(chance.randrange(len(places)))
        chance.shuffle(mutations)
        drawn += [mutation for mutation in mutations if means_something_else(root, mutation)][:1]
    return drawn


def means_something_else(root: Path, mutation: Mutation) -> bool:
    """Whether the mutated file compiles, and into another program than the file as it is."""
    source = (root / mutation.path).read_text(encoding="utf-8")
    try:
        mutated = ast.parse(mutation.applied(source))
        compile(mutated, mutation.path, "exec")
    except SyntaxError:
        return False
    return ast.dump(mutated) != ast.dump(ast.parse(source))


def _by_line(root: Path, folder: str) -> list[list[Mutation]]:
    places: defaultdict[tuple[str, int], list[Mutation]] = defaultdict(list)
    for file in sorted((root / folder).rglob("*.py")):
        path = file.relative_to(root).as_posix()
        for mutation in mutations_of(path, file.read_text(encoding="utf-8")):
            places[path, mutation.line].append(mutation)
    return list(places.values())


def mutations_of(path: str, source: str) -> Iterator[Mutation]:
    """All single mutations of a file; a few of them do not compile."""
    lines = source.encode().splitlines(keepends=True)
    for edit in _Finder(lines).found(ast.parse(source)):
        first = edit.start[0] - 1
        block = lines[first : edit.end[0]]
        end = sum(map(len, block[:-1])) + edit.end[1]
        before = b"".join(block)
        after = before[: edit.start[1]] + edit.text.encode() + before[end:]
        yield Mutation(path, first + 1, edit.kind, before.decode(), after.decode())


@dataclass(frozen=True)
class _Edit:
    kind: str
    start: tuple[int, int]
    end: tuple[int, int]
    text: str


class _Finder(ast.NodeVisitor):
    """Walks a file; annotations, decorators, docstrings and what only type checkers read are left out."""

    def __init__(self, lines: list[bytes]) -> None:
        self.lines = lines
        self.edits: list[_Edit] = []
        self.last_statements: set[ast.stmt] = set()

    def found(self, tree: ast.Module) -> list[_Edit]:
        self.visit(tree)
        return self.edits

    # -- expressions

    def visit_Compare(self, node: ast.Compare) -> None:
        operands = [node.left, *node.comparators]
        for left, operator, right in zip(operands, node.ops, operands[1:], strict=False):
            token, others = COMPARED[type(operator)]
            is_none = isinstance(right, ast.Constant) and right.value is None
            for other in others:
                self._replace_between("is None" if is_none else "comparison", left, right, token, other)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in COMPUTED:
            self._replace_between("arithmetic", node.left, node.right, *COMPUTED[type(node.op)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        tokens = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._replace_between("boolean", left, right, *tokens)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        kind = {ast.Not: "not", ast.USub: "arithmetic"}.get(type(node.op))
        if kind:
            self._replace(kind, node, self._text(node.operand), start=_start(node))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._replace("boolean", node, str(not value))
        elif isinstance(value, int | float) and not isinstance(value, complex):
            if value in UNIT_FACTORS:
                self._replace("unit factor", node, "1" if isinstance(value, int) else "1.0")
            elif isinstance(value, int):
                self._replace("off by one", node, str(value + 1))
                self._replace("off by one", node, f"{value - 1}" if value else "(-1)")
            else:
                self._replace("constant", node, repr(2 * value if value else 1.0))

    def visit_Call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Name) and node.func.id in SWAPPED:
            self._replace("min and max", node.func, SWAPPED[node.func.id])
        if isinstance(node.func, ast.Attribute) and node.func.attr in SWAPPED:
            self._replace("min and max", node.func, f"{self._text(node.func.value)}.{SWAPPED[node.func.attr]}")
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg != "strict":  # zip's guard against a mistake in the program: not behaviour
            self.generic_visit(node)

    # -- statements

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) == "TYPE_CHECKING" or "__name__" in ast.unparse(node.test):
            return
        self._negate(node.test)
        self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.last_statements.add(node.body[-1])
        self.visit(node.args)
        for statement in node.body:
            self.visit(statement)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for statement in node.body:
            self.visit(statement)

    def visit_arg(self, node: ast.arg) -> None:
        pass

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if all(isinstance(target, ast.Attribute | ast.Subscript) for target in node.targets):
            self._replace("removed statement", node, "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._replace("removed statement", node, "pass")
        if type(node.op) in COMPUTED:
            token, other = COMPUTED[type(node.op)]
            self._replace_between("arithmetic", node.target, node.value, f"{token}=", f"{other}=")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._replace("removed statement", node, "pass")
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        if node not in self.last_statements:
            self._replace("early return", node, "pass")
        self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        self._replace("removed statement", node, "pass")
        self.generic_visit(node)

    def _visit_jump(self, node: ast.stmt) -> None:
        self._replace("removed statement", node, "pass")

    visit_Continue = visit_Break = visit_Delete = _visit_jump

    # -- edits

    def _negate(self, test: ast.expr) -> None:
        if not isinstance(test, ast.UnaryOp | ast.Compare):
            self._replace("not", test, f"(not ({self._text(test)}))")

    def _replace(self, kind: str, node: ast.expr | ast.stmt, text: str, start: tuple[int, int] | None = None) -> None:
        # Inside f-strings Python 3.11 does not always say where an expression stands: then it is left as it is.
        if not isinstance(node, ast.Constant) or _value(self._text(node)) == node.value:
            self.edits.append(_Edit(kind, start or _start(node), _end(node), text))

    def _replace_between(self, kind: str, left: ast.expr, right: ast.expr, token: str, other: str) -> None:
        between = self._slice(_end(left), _start(right))
        pattern = re.escape(token).replace(r"\ ", r"\s+")
        if re.fullmatch(BESIDE + pattern + BESIDE, between):
            text = re.sub(pattern, other, between, count=1)
            self.edits.append(_Edit(kind, _end(left), _start(right), text))

    def _text(self, node: ast.expr | ast.stmt) -> str:
        return self._slice(_start(node), _end(node))

    def _slice(self, start: tuple[int, int], end: tuple[int, int]) -> str:
        block = self.lines[start[0] - 1 : end[0]]
        before_last = sum(map(len, block[:-1]))
        return b"".join(block)[start[1] : before_last + end[1]].decode()


def _start(node: ast.expr | ast.stmt) -> tuple[int, int]:
    return node.lineno, node.col_offset


def _end(node: ast.expr | ast.stmt) -> tuple[int, int]:
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    return node.end_lineno, node.end_col_offset


def _value(text: str) -> object:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return None
