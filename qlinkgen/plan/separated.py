"""Payloads of texts between separators, such as ``7.6,0.0,``.

An absent field is an empty text. At the end, absent fields are left out with the separators before them.
A receiver checks the number of texts first; then, in wire order, the size of each, and its value.
"""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.plan import walk
from qlinkgen.plan.payload import BytesStep, ConstantStep, PayloadPlan, ReservedStep, ValueStep
from qlinkgen.plan.walk import Visit, Wrong

#: The steps that a text between separators can be.
TextStep = ValueStep | ConstantStep | ReservedStep | BytesStep


def text_steps(plan: PayloadPlan) -> tuple[TextStep, ...]:
    """The steps of a payload with separators."""
    return tuple(step for step in plan.steps if isinstance(step, TextStep))


def needed(plan: PayloadPlan) -> int:
    """Minimum number of texts, at least 1: those up to the last one that cannot be absent."""
    before = int(plan.leading)
    places = (index for index, step in enumerate(plan.steps, 1 + before) if step.presence is None)
    return max(places, default=1)


def most_texts(plan: PayloadPlan) -> int:
    """Maximum number of texts, the empty one before a leading separator included."""
    return len(plan.steps) + plan.leading


def characters(step: TextStep) -> tuple[int, int]:
    """Minimum and maximum number of characters of a text that is not absent."""
    if isinstance(step, BytesStep):
        return step.length.minimum, step.length.maximum
    text = step.integer.text
    assert text is not None
    return text.shortest, text.most


def joined(plan: PayloadPlan, texts: list[bytes]) -> bytes:
    """The payload of the texts of all fields."""
    texts = [b"", *texts] if plan.leading else texts
    while len(texts) > needed(plan) and not texts[-1]:
        texts.pop()
    return plan.separator.join(texts)


def visit(plan: PayloadPlan, payload: bytes) -> Iterator[Visit]:
    """The steps of a payload, each before its value is used to find later ones. Raises Wrong."""
    if not plan.separator:
        yield from walk.visit(plan, payload)
        return
    texts, steps, at = payload.split(plan.separator), text_steps(plan), 0
    if not needed(plan) <= len(texts) <= most_texts(plan) or (plan.leading and texts[0]):
        raise Wrong("", 0)
    if plan.leading:
        texts, at = texts[1:], min(1, len(payload))
    for index, step in enumerate(steps):
        text = texts[index] if index < len(texts) else b""
        if step.presence is not None and not text:
            yield Visit(step, at, None)
        else:
            least, most = characters(step)
            if not least <= len(text) <= most:
                raise Wrong(step.name, at)
            yield Visit(step, at, text)
        at = min(at + len(text) + 1, len(payload))
