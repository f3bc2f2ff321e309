# SPDX-License-Identifier: Apache-2.0
"""Mutants of a source file: copies with one small change each, which the tests ought to notice."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass, field

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Mod: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
FUNCTIONS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}


_Step = tuple[str, int | None]  # a field of a node, and the index if it holds a list


@dataclass(frozen=True)
class Mutant:
    """One change of a source file."""

    line: int
    column: int
    change: str
    _tree: ast.Module = field(repr=False)
    _position: tuple[_Step, ...] = field(repr=False)
    _replacement: ast.AST = field(repr=False)

    @property
    def source(self) -> str:
        """The whole file with the change."""
        changed = copy.deepcopy(self._tree)
        _put(changed, self._position, self._replacement)
        return ast.unparse(ast.fix_missing_locations(changed))

    def __str__(self) -> str:
        return f"{self.line}:{self.column}: {self.change}"


def mutants(source: str) -> list[Mutant]:
    """Return all mutants of a module in the order of its lines.

    Changed are comparisons, arithmetic, `and` and `or`, numbers, True and False, min and max; conditions are negated, statements removed.
    Texts, type annotations, decorators, imports and the texts of errors are not changed.
    """
    tree = ast.parse(source)
    found = [
        Mutant(node.lineno, node.col_offset, change, tree, position, replacement)
        for node, position in _nodes(tree)
        if isinstance(node, (ast.expr, ast.stmt))
        for change, replacement in _changes(node)
    ]
    return sorted(found, key=lambda mutant: (mutant.line, mutant.column))


_SKIPPED = {"annotation", "returns", "decorator_list", "type_params"}


def _nodes(node: ast.AST, position: tuple[_Step, ...] = ()) -> Iterator[tuple[ast.AST, tuple[_Step, ...]]]:
    """Yield the nodes that may be changed, each with the steps from the root that lead to it."""
    if isinstance(node, (ast.Raise, ast.Import, ast.ImportFrom, ast.JoinedStr)):
        return
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return
    yield node, position
    for name, value in ast.iter_fields(node):
        if name in _SKIPPED or (isinstance(node, ast.ClassDef) and name == "keywords"):
            continue
        if isinstance(value, ast.AST):
            yield from _nodes(value, (*position, (name, None)))
        elif isinstance(value, list):
            for index, item in enumerate(value):
                if isinstance(item, ast.AST):
                    yield from _nodes(item, (*position, (name, index)))


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the changes of one node, each with what replaces it."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        operator = COMPARISONS[type(node.ops[0])]()
        yield _as_text(node, ast.Compare(node.left, [operator, *node.ops[1:]], node.comparators))
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        yield _as_text(node, ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right))
    elif isinstance(node, ast.BoolOp):
        yield _as_text(node, ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        yield _as_text(node, node.operand)
    elif isinstance(node, ast.Constant):
        yield from _changed_constant(node)
    elif isinstance(node, ast.Call) and (name := _name(node.func)) in FUNCTIONS:
        called = copy.deepcopy(node)
        if isinstance(called.func, ast.Name):
            called.func.id = FUNCTIONS[name]
        elif isinstance(called.func, ast.Attribute):
            called.func.attr = FUNCTIONS[name]
        yield _as_text(node, called)
    elif isinstance(node, (ast.If, ast.IfExp, ast.While)) and not isinstance(node.test, (ast.Compare, ast.BoolOp, ast.UnaryOp)):
        negated = copy.deepcopy(node)
        negated.test = ast.UnaryOp(ast.Not(), negated.test)
        yield f"condition {_short(node.test)} negated", negated
    elif isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)) or _sets_attribute(node):
        yield f"without {_short(node)}", ast.Pass()


def _changed_constant(node: ast.Constant) -> Iterator[tuple[str, ast.AST]]:
    if isinstance(node.value, bool):
        yield _as_text(node, ast.Constant(not node.value))
    elif isinstance(node.value, (int, float)):
        yield _as_text(node, ast.Constant(node.value + 1))


def _sets_attribute(node: ast.AST) -> bool:
    return isinstance(node, ast.Assign) and any(isinstance(target, (ast.Attribute, ast.Subscript)) for target in node.targets)


def _name(function: ast.expr) -> str:
    return function.id if isinstance(function, ast.Name) else function.attr if isinstance(function, ast.Attribute) else ""


def _as_text(before: ast.AST, after: ast.AST) -> tuple[str, ast.AST]:
    return f"{_short(before)} -> {_short(after)}", after


def _short(node: ast.AST, most: int = 60) -> str:
    text = ast.unparse(node).replace("\n", " ")
    return text if len(text) <= most else text[: most - 3] + "..."


def _put(tree: ast.AST, position: tuple[_Step, ...], replacement: ast.AST) -> None:
    """Replace the node to which the steps lead."""
    place = tree
    for name, index in position[:-1]:
        value = getattr(place, name)
        place = value if index is None else value[index]
    name, index = position[-1]
    if index is None:
        setattr(place, name, replacement)
    else:
        getattr(place, name)[index] = replacement
