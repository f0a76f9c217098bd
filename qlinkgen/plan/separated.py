"""Payloads of texts between separators, such as ``7.6,0.0,``.

An absent field is an empty text. At the end, absent fields are left out with the separators before them.
A receiver checks the number of texts first; then, in wire order, the size of each, and its value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from qlinkgen.plan import walk
from qlinkgen.plan.payload import (
    BytesStep,
    ConstantStep,
    CountStep,
    ItemsStep,
    PayloadPlan,
    ReservedStep,
    ValueStep,
)
from qlinkgen.plan.walk import Visit, Wrong

_NONE: Mapping[str, object] = {}
#: The steps that texts between separators can be.
TextStep = ValueStep | ConstantStep | ReservedStep | CountStep | BytesStep | ItemsStep


def text_steps(plan: PayloadPlan) -> tuple[TextStep, ...]:
    """The steps of a payload with separators."""
    return tuple(step for step in plan.steps if isinstance(step, TextStep))


def least_texts(step: TextStep) -> int:
    """Minimum number of texts of a step that is present."""
    return step.length.minimum if isinstance(step, ItemsStep) else 1


def greatest_texts(step: TextStep) -> int:
    """Maximum number of texts of a step."""
    return step.length.maximum if isinstance(step, ItemsStep) else 1


def needed_steps(plan: PayloadPlan) -> int:
    """Number of steps up to the last one that cannot be left out."""
    steps = enumerate(text_steps(plan), 1)
    return max((index for index, step in steps if step.presence is None and least_texts(step)), default=0)


def needed(plan: PayloadPlan) -> int:
    """Minimum number of texts, at least 1: those up to the last one that cannot be absent."""
    texts = sum(map(least_texts, text_steps(plan)[: needed_steps(plan)]))
    return max(1, texts + plan.leading if texts else 0)


def most_texts(plan: PayloadPlan) -> int:
    """Maximum number of texts, the empty one before a leading separator included."""
    return sum(map(greatest_texts, text_steps(plan))) + plan.leading


def open_list(plan: PayloadPlan) -> ItemsStep | None:
    """The list that takes the texts that the other steps leave, None if there is none."""
    return next((step for step in text_steps(plan) if isinstance(step, ItemsStep) and not step.fixed), None)


def texts_behind(plan: PayloadPlan) -> int:
    """Number of texts after the open list, all of which are needed; 0 if it is the last step."""
    steps, opened = text_steps(plan), open_list(plan)
    return sum(map(greatest_texts, steps[steps.index(opened) + 1 :])) if opened else 0


def counts_of(plan: PayloadPlan, run: ItemsStep) -> tuple[CountStep, ...]:
    """The steps before a list that tell how many items it has."""
    return tuple(step for step in plan.steps if isinstance(step, CountStep) and step.run == run.name)


def skipped(plan: PayloadPlan) -> ItemsStep | None:
    """The open list before other steps if it may have no items, and then no separator; else None."""
    opened = open_list(plan)
    return opened if opened and not opened.length.minimum and texts_behind(plan) else None


def characters(step: TextStep) -> tuple[int, int]:
    """Minimum and maximum number of characters of a text, or item, that is not absent."""
    if isinstance(step, BytesStep):
        return step.length.minimum, step.length.maximum
    text = (step.item if isinstance(step, ItemsStep) else step.integer).text
    assert text is not None
    return text.shortest, text.most


def joined(plan: PayloadPlan, texts: list[bytes]) -> bytes:
    """The payload of the texts of all steps."""
    steps, empty = text_steps(plan), skipped(plan)
    texts = [text for step, text in zip(steps, texts, strict=True) if text or step is not empty]
    while len(texts) > needed_steps(plan) and not texts[-1]:
        texts = texts[:-1]
    texts = texts or [b""] * (not plan.leading)
    return plan.separator.join([b"", *texts] if plan.leading else texts)


def _taken(step: TextStep, texts: list[bytes], behind: int) -> list[bytes]:
    """The texts of a step from those that are left; an absent one is an empty text."""
    if not isinstance(step, ItemsStep):
        return texts[:1] or [b""]
    own = texts[: step.length.maximum if step.fixed else len(texts) - behind]
    return [] if own == [b""] and not step.length.minimum and not behind else own


def visit(plan: PayloadPlan, payload: bytes, beside: Mapping[str, object] = _NONE) -> Iterator[Visit]:
    """The steps of a payload, each before its value is used to find later ones. Raises Wrong.

    A list is visited once for each item, or once with no bytes if it has none. ``beside`` are raw values of
    the frame.
    """
    if not plan.separator:
        yield from walk.visit(plan, payload, beside)
        return
    texts, at = payload.split(plan.separator), 0
    if not needed(plan) <= len(texts) <= most_texts(plan) or (plan.leading and texts[0]):
        raise Wrong("", 0)
    if plan.leading:
        texts, at = texts[1:], min(1, len(payload))
    yield from _visit_texts(plan, texts, at, len(payload))


def _visit_texts(plan: PayloadPlan, texts: list[bytes], at: int, end: int) -> Iterator[Visit]:
    """The steps of texts, the first of which is at an offset of a payload of ``end`` bytes."""
    behind, told = texts_behind(plan), dict[str, tuple[int, bytes]]()
    for step in text_steps(plan):
        own = _taken(step, texts, behind)
        texts = texts[len(own) :]
        if not own:
            yield Visit(step, at, b"")
        for text in own:
            if step.presence is not None and not text:
                yield Visit(step, at, None)
            else:
                least, most = characters(step)
                if not least <= len(text) <= most:
                    raise Wrong(step.name, at)
                yield Visit(step, at, text)
            if isinstance(step, CountStep):
                told[step.name] = at, text
            at = min(at + len(text) + 1, end)
        if isinstance(step, ItemsStep):
            _check_told(plan, step, len(own), told)


def _check_told(
    plan: PayloadPlan, run: ItemsStep, number: int, told: Mapping[str, tuple[int, bytes]]
) -> None:
    """Check the counts of a list, whose places and texts are ``told``. Raises Wrong."""
    for count in counts_of(plan, run):
        at, text = told[count.name]
        if not count.integer.stray(text) and count.integer.unpack(text) != number:
            raise Wrong(count.name, at)
