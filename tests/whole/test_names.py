"""Names used by generated functions, in many shapes of frames."""

from __future__ import annotations

import re

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.model import naming
from qlinkgen.schema import loads
from tests.support.whole import schemas

_FUNCTION = re.compile(r"^static inline ([^;{]*?)\{\n(.*?)^\}\n", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
#: Lower case, and not a struct member.
_WORD = re.compile(r"(?<![\w>.])[a-z_]\w*")


@pytest.mark.slow
def test_no_address_is_called_like_another_word_of_its_functions_in_c() -> None:
    found: set[str] = set()
    for seed in range(150):
        protocol, _ = loads(schemas.generate(seed), "whole.yaml")
        name = protocol.address_name if protocol else ""
        if protocol is None or not name:
            continue
        own = naming.address_member(name)
        text = _COMMENT.sub("", "".join(c.generate(protocol, Options()).values()))
        for head, body in _FUNCTION.findall(text):
            if re.search(rf"\b{own}[,)]", head):
                words = set(_WORD.findall(head + body)) - {own}
                found |= {word for word in words if not word.startswith(protocol.name)}
    assert "payload" in found
    assert {word for word in found if naming.address_member(word) == word} == set()
