"""Pairs of features, and seeds that have all of them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

from tests.support.whole.pairs import cover, features
from tests.support.whole.schemas import generate


def test_features_are_keys_of_the_language_with_their_places() -> None:
    text = """
    protocol: {name: key}
    frame: {parts: {start: A5, code: {role: message, type: u8}, data: {role: payload, size: 0..9}}}
    commands: {bits: {request: {range: {type: "i16[2]", range: 0..3}}, response: none}}
    """
    assert features(text) == {
        "schema protocol", "schema frame", "schema parts", "part role message", "part u", "part role payload",
        "part size", "schema commands", "command request", "command response", "field i[]", "field range",
    }  # fmt: skip


def test_chosen_seeds_have_every_pair() -> None:
    texts = {seed: generate(seed, hostile=False) for seed in range(20)}
    texts[20] = texts[0]
    found = cover(texts)

    def pairs(seeds: Iterable[int]) -> set[tuple[str, str]]:
        return {pair for seed in seeds for pair in combinations(sorted(features(texts[seed])), 2)}

    assert pairs(found.seeds) == pairs(texts)
    assert len(pairs(texts)) == found.found < found.possible
    assert len(found.seeds) < len(texts)
