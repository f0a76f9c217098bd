"""Whole random schemas, reproducible by seed."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from tests.support.whole import frames, kinds, text_ids, words
from tests.support.whole.decided import decide
from tests.support.whole.fields import FieldMaker, Room
from tests.support.whole.frames import Shape
from tests.support.whole.hosts import come_back
from tests.support.whole.kinds import Kinds
from tests.support.whole.reference.notation import whole_span
from tests.support.whole.settled import settle

Doc = dict[str, Any]
_PLAIN = re.compile(r"[a-z][a-z0-9_]*\Z", re.ASCII)
_YAML_WORDS = frozenset("true false null yes no on off y n nan inf".split())  # noqa: SIM905
#: One in this number of schemas has mostly fields of variable size.
_VARIABLE = 5
#: One in this number of schemas with a master has a link instead.
_LINK = 9
#: One in this number of schemas has several kinds of frame.
_KINDS = 8
_MEANS = ("refused", "again", "pending", "done")
#: Mappings below this depth are written on one line.
_BLOCKS = 4


def generate(seed: int, *, hostile: bool = False) -> str:
    """The text of a schema; `hostile` selects names and texts of `words` that break careless generators."""
    return dump(_Maker(seed, hostile=hostile).make())


@dataclass
class Words:
    """Draws names and texts."""

    rng: random.Random
    hostile: bool

    def name(self, taken: set[str]) -> str:
        """A name that is unique in a scope, including names of counts."""
        while True:
            odd = self.hostile and self.rng.random() < 0.35
            name = self.rng.choice(words.HOSTILE if odd else words.NAMES)
            if self.rng.random() < 0.3:
                name += f"_{self.rng.randrange(10)}"
            names = {name, f"{name}_count", f"{name}_size"}
            if not names & taken:
                taken |= names
                return name

    def text(self) -> str:
        """A description."""
        return self.rng.choice(
            words.HOSTILE_TEXTS if self.hostile and self.rng.random() < 0.5 else words.TEXTS
        )

    def unit(self) -> str:
        """A unit."""
        return self.rng.choice(
            words.HOSTILE_UNITS if self.hostile and self.rng.random() < 0.5 else words.UNITS
        )


@dataclass
class _Maker:
    seed: int
    hostile: bool
    _ids: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.rng = random.Random(f"whole schema {self.seed}")
        self.words = Words(self.rng, self.hostile)

    def make(self) -> Doc:
        rng = self.rng
        several = kinds.draw(rng) if self.seed % _KINDS == _KINDS - 1 else None
        shape = several.families[0].shape if several else frames.choose(rng, self.words)
        protocols = words.HOSTILE_PROTOCOLS if self.hostile and rng.random() < 0.3 else words.PROTOCOLS
        document: Doc = {
            "qlinkgen": 1,
            "protocol": {
                "name": rng.choice(protocols),
                "title": self.words.text(),
                "revision": "1",
                "source": self.words.text(),
                "doc": self.words.text(),
            },
            "byteorder": rng.choice(("big", "little")),
        }
        if shape.groups:
            document["groups"] = shape.groups
        maker = FieldMaker(rng, self.words, shape)
        if self.seed % _VARIABLE == _VARIABLE - 1:
            maker.variable = 0.7
        document |= maker.types()
        document |= {"frames": several.frames} if several else {"frame": shape.frame}
        document["bus"] = self._bus(shape)
        if several:
            document |= self._kinds(several, maker, document["bus"])
            kinds.lead_with_ids(random.Random(f"ids {self.seed}"), several)
            kinds.lead_with_addresses(random.Random(f"addresses {self.seed}"), several, document["bus"])
            kinds.lead_with_bits(random.Random(f"bits {self.seed}"), several)
            self._dialogue_by_turn(several, maker, document["commands"])
        else:
            document |= self._traffic(shape, maker, document["bus"])
        parties = shape.master is not None
        asks = not parties or bool(document.get("commands"))
        if shape.bus == "master_slave" and asks and self.seed % (3 if parties else _LINK) == 1:
            _link(rng, document)
        _stop_answers(random.Random(f"streams {self.seed}"), document)
        _begin_with_break(random.Random(f"break {self.seed}"), document)
        come_back(random.Random(f"resync {self.seed}"), document)
        if not several:
            text_ids.draw(random.Random(f"text ids {self.seed}"), document)
        if several:
            _usual_kind(random.Random(f"usual {self.seed}"), document)
        maker.forget_unused(document)
        if not several:
            _name_parts(rng, document)
        return document

    def _kinds(self, several: Kinds, maker: FieldMaker, bus: Doc) -> Doc:
        """Commands and messages, each in frames of its kind."""
        found: Doc = {"commands": {}, "messages": {}}
        taken: set[str] = set(maker.taken)
        for family in several.families:
            self._ids, shape = family.ids, family.shape
            makes = replace(maker, shape=shape)
            asks = bool(shape.address_bits) or not several.addressed
            tiny = shape.id_bits == 0
            for _ in range(self.rng.randint(0, 2) if asks and not tiny and not family.ended else 0):
                command = self._command(shape, makes, bus, attributes=False)
                found["commands"][self.words.name(taken)] = command | family.spec
            for _ in range(1 if tiny else self.rng.randint(1, 2)):
                message = self._message(shape, makes, "messages", texts=family.ended)
                if not asks or tiny:
                    message["direction"] = "response"
                found["messages"][self.words.name(taken)] = message | family.spec
        self._answered_otherwise(several, maker, found)
        _refuse_shortly(random.Random(repr(self.rng.getstate())), several, found)
        kinds.turn(random.Random(f"turn {self.rng.getstate()!r}"), several, found)
        self._seeds(
            next((each.shape for each in several.families if each.shape.seeds), several.families[0].shape),
            found,
        )
        return {key: value for key, value in found.items() if value or key == "commands"}

    def _answered_otherwise(self, several: Kinds, maker: FieldMaker, found: Doc) -> None:
        """Let some commands be answered by a message, or in a frame of another kind."""
        rng = self.rng
        sent = [name for name, spec in found["messages"].items() if spec.get("direction") == "response"]
        for spec in found["commands"].values():
            if spec["response"] == "none":
                continue
            if sent and rng.random() < 0.3:
                spec["response"] = rng.choice(sent)
                continue
            family = rng.choice([each for each in several.families if not each.ended])
            texts = "separator" in spec
            if family.name and family.shape.id_bits and not texts and rng.random() < 0.5:
                self._ids = family.ids
                fields = replace(maker, shape=family.shape).fields(Room.of(family.shape))
                spec["response"] = {"frame": family.name, **self._identified(family.shape), "fields": fields}

        if several.families[0].shape.bus == "master_slave" and rng.random() < 0.5:
            self._dialogue_in_kinds(several, maker, found, sent)

    def _dialogue_in_kinds(self, several: Kinds, maker: FieldMaker, found: Doc, sent: list[str]) -> None:
        """Let one command be a dialogue of frames of several kinds."""
        rng = self.rng
        fit = [each for each in found["commands"].values() if self._may_have_steps(each)]
        asking = [each for each in several.families if each.shape.address_bits or not several.addressed]
        asking = [each for each in asking if each.name and each.shape.id_bits and not each.ended]
        if not fit or isinstance(fit[0]["response"], str) or "separator" in fit[0]:
            return
        steps: list[Doc] = []
        for key in rng.choices(("send", "receive"), k=rng.randint(1, 3)):
            if key == "receive" and sent:
                steps.append({key: rng.choice(sent)})
            elif asking:
                family = rng.choice(asking)
                self._ids = family.ids
                fields = replace(maker, shape=family.shape).fields(Room.of(family.shape))
                own = {"frame": family.name, **self._identified(family.shape), "fields": fields}
                steps.append({key: own})
        fit[0]["steps"] = [*steps, {"receive": "response"}]

    def _dialogue_by_turn(self, several: Kinds, maker: FieldMaker, commands: Doc) -> None:
        """Let only their turn tell some frames of a dialogue."""
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        rng = random.Random(f"turn {self.seed}")
        fit = [each for each in commands.values() if self._may_have_steps(each) and "separator" not in each]
        fit = [each for each in fit if not isinstance(each["response"], str)]
        command = next((each for each in fit if "steps" in each), fit[0] if fit else None)
        if command is None or several.families[0].shape.bus != "master_slave" or rng.random() < 0.1:
            return
        name, most = "raw", rng.choice((40, 60, 280))
        shape = Shape("kinds", {"parts": {}}, 1, most, 0, several.families[0].shape.bus, has_length=False)
        makes = replace(maker, rng=rng, shape=shape, words=Words(rng, self.hostile))
        steps = command.setdefault("steps", [{"receive": "response"}])
        for key in rng.choices(("send", "receive"), k=rng.randint(1, 3)):
            if key == "receive" or not several.addressed:
                fields = makes.fields(Room.of(shape)) or {"data": "u16"}
                limit = {"within": "1 s"} if key == "send" else {}
                step = {key: {"frame": name, "fields": fields}, **limit}
                steps.insert(rng.randrange(len(steps)), step)
        if not several.addressed and rng.random() < 0.4:
            number = rng.choice(({"range": "1..16"}, {"range": "1..16", "offset": 1}, {"range": "2..20"}))
            last = f"{rng.choice(('bytes', 'u16', 'text', 'u8'))}[amount.count]"
            around = rng.choice(({}, {"mark": "u8"}))
            asked = {"frame": name, "fields": {"count": {"type": "u8", **number}}}
            told = {"frame": name, "fields": {**around, "data": last}}
            del steps[-1], command["response"]
            steps += [{"name": "amount", "send": asked, "within": "1 s"}, {"receive": told}]
        given = [each for step in steps for each in step.values() if isinstance(each, dict)]
        for other in (each for each in fit if "steps" not in each):
            if rng.random() < 0.8:
                fields = makes.fields(Room.of(shape)) or {"data": "u16"}
                other["response"] = {"frame": name, "fields": fields}
                kinds.prove(rng, several.frames.get(other.get("frame", ""), {}), fields)
                given.append(other["response"])
                if kinds.prove_by_kind(rng, several, other["response"], most):
                    given.pop()
        if any(each.get("frame") == name for each in given):
            several.frames[name] = {"parts": {"data": {"role": "payload", "size": f"1..{most}"}}}

    def _bus(self, shape: Shape) -> Doc:
        rng = self.rng
        bus: Doc = {"kind": shape.bus}
        if shape.address_bits:
            bus |= self._addresses(shape)
        if shape.master is not None:
            bus["master"] = shape.master
        if rng.random() < 0.5:
            bus["baud"] = rng.choice((9600, 19200, 115200))
        if rng.random() < 0.3:
            bus["bits_per_byte"] = 11
        if rng.random() < 0.7:
            bus["response_within"] = rng.choice(("3 bytes", "260 us", "10 ms", "1 s"))
        return bus

    def _addresses(self, shape: Shape) -> Doc:
        rng, top = self.rng, shape.address_top or (1 << shape.address_bits) - 1
        least = 1 if shape.kind == "marked" else 0
        ranges = ((1, 8), (0, top), (1, top - 1), (0, 3), (top, top), (top // 2, top - 1))
        first, last = (min(max(end, least), top) for end in rng.choice(ranges))
        bus: Doc = {"nodes": f"{first}..{last}"}
        free = [each for each in (0, top, last + 1) if not first <= each <= last and least <= each <= top]
        if free and rng.random() < 0.7:
            bus["broadcast"] = rng.choice(free)
        return bus

    def _traffic(self, shape: Shape, maker: FieldMaker, bus: Doc) -> Doc:
        rng = self.rng
        kinds = rng.choices(("both", "commands", "messages", "undirected"), (5, 3, 1, 1))[0]
        if shape.kind == "packet":
            kinds = rng.choice(("both", "commands"))
        elif shape.directed and kinds == "undirected":
            kinds = "messages"
        found: Doc = {}
        taken: set[str] = set(maker.taken)
        if rng.random() < 0.3:
            found["attributes"] = {"level": {"doc": self.words.text(), "values": ["user", "service"]}}
        if shape.id_bits == 0:
            found |= self._only(shape, maker, bus, taken, attributes="attributes" in found)
        else:
            found |= self._several(shape, maker, bus, taken, kinds, attributes="attributes" in found)
        self._seeds(shape, found)
        settle(rng, shape, found)
        if self.seed % 4:
            decide(random.Random(f"decided {self.seed}"), shape, found)
        return found

    def _several(
        self, shape: Shape, maker: FieldMaker, bus: Doc, taken: set[str], kinds: str, *, attributes: bool
    ) -> Doc:
        rng = self.rng
        found: Doc = {"commands": {}}
        free = (1 << shape.id_bits) - (shape.end_id >= 0)
        if kinds in ("both", "commands"):
            for _ in range(rng.randint(1, min(4, free - 1))):
                name = self.words.name(taken)
                found["commands"][name] = self._command(shape, maker, bus, attributes=attributes)
        found["messages"] = {}
        if kinds != "commands":
            for _ in range(rng.randint(1, min(3, free - len(found["commands"])))):
                found["messages"][self.words.name(taken)] = self._message(shape, maker, kinds)
        if shape.only:
            names = [*found["commands"], *found["messages"]]
            shape.frame["marked"]["checksum"]["only"] = rng.sample(names, rng.randint(1, len(names)))
        if found["commands"] and shape.kind != "packet" and rng.random() < 0.4:
            self._answers(shape, maker, found)
        if found["commands"] and shape.ways:
            self._picked(shape, maker, found)
        return {key: value for key, value in found.items() if value or key == "commands"}

    def _only(self, shape: Shape, maker: FieldMaker, bus: Doc, taken: set[str], *, attributes: bool) -> Doc:
        """The traffic of a frame without a message id: one message for each direction."""
        name = self.words.name(taken)
        if self.rng.random() < 0.7:
            return {"commands": {name: self._command(shape, maker, bus, attributes=attributes)}}
        return {"commands": {}, "messages": {name: self._message(shape, maker, "messages")}}

    def _command(self, shape: Shape, maker: FieldMaker, bus: Doc, *, attributes: bool) -> Doc:
        rng = self.rng
        command: Doc = self._identified(shape)
        addressing = "node"
        if shape.address_bits:
            most = (
                ("node", "node", "broadcast", "either", "answered_broadcast")
                if "broadcast" in bus
                else ("node",)
            )
            addressing = command["addressing"] = rng.choice(most)
        silent = addressing == "broadcast" or (addressing != "answered_broadcast" and rng.random() < 0.2)
        if self._separable(shape) and rng.random() < 0.15:
            command["separator"] = rng.choice((",", ";", " ", "\t", {"before": ","}, {"before": ";"}))
            request = maker.texts(Room.of(shape))
            response = "none" if silent else maker.texts(Room.of(shape))
        else:
            request = maker.fields(Room.of(shape))
            response = "none" if silent else self._response(shape, maker, request)
        command |= {"request": request, "response": response, "repeat": rng.choice(("safe", "unsafe"))}
        counters = [name for name, spec in request.items() if spec in ("u8", "u16")]
        if counters and rng.random() < 0.4:
            command["repeat"] = {"counter": rng.choice(counters)}
        varying = {"if", "optional", "switch", "terminator"}
        absent = any(isinstance(spec, dict) and varying & spec.keys() for spec in request.values())
        absent = absent or any(maker.is_varied(spec) for spec in request.values())
        distinct = "separator" not in command and shape.has_length and not shape.trimmed and not absent
        if distinct and request and not shape.least and rng.random() < 0.15:
            command["empty_request"] = "defaults"
        if rng.random() < 0.2:
            command["in_flight"] = rng.randint(1, 3)
        if attributes:
            command["attributes"] = {"level": rng.choice(("user", "service"))}
        if rng.random() < 0.3:
            command["response_within"] = "20 ms"
        return self._described(command)

    def _seeds(self, shape: Shape, found: Doc) -> None:
        """Give every message the attributes that check values cover."""
        for name, spec in shape.seeds.items():
            found.setdefault("attributes", {})[name] = spec
            top = (1 << int(spec["type"][1:])) - 1
            for each in (*found["commands"].values(), *found.get("messages", {}).values()):
                each.setdefault("attributes", {})[name] = self.rng.choice((0, top, self.rng.randint(0, top)))
            if found.get("replies"):
                defaults = found.setdefault("defaults", {})
                defaults.setdefault("attributes", {})[name] = self.rng.randint(0, top)

    def _answers(self, shape: Shape, maker: FieldMaker, found: Doc) -> None:
        """Give answers numbers of their own, and other replies to the commands."""
        rng, used = self.rng, {("request", number) for number in self._ids}
        used |= {("response", number) for number in self._ids}
        answered = {name: spec for name, spec in found["commands"].items() if spec["response"] != "none"}
        sent = [name for name, spec in found["messages"].items() if spec.get("direction") == "response"]
        for spec in answered.values():
            if sent and rng.random() < 0.3:
                spec["response"] = rng.choice(sent)
                continue
            self._more_of(shape, spec)
            asked = [shape.number(spec["id"])]
            number = self._answer_id(shape, asked, used, relative=rng.random() < 0.5)
            if number is not None and rng.random() < 0.4:
                spec["response"] = {"id": number, "fields": spec["response"]}
                if means := self._means(spec["response"]["fields"]):
                    spec["response"]["means"] = means
        taken = {*found["commands"], *found["messages"], "request", "response"}
        self._told_by_request(shape, maker, found, (used, taken))
        if answered and rng.random() < 0.7:
            relative = rng.random() < 0.6
            asked = [shape.number(each["id"]) for each in answered.values()]
            number = self._answer_id(shape, asked, used, relative=relative)
            if number is not None:
                found["replies"] = {self.words.name(taken): self._reply(shape, maker, number)}
        if answered and rng.random() < 0.5:
            spec = rng.choice(list(answered.values()))
            asked = [shape.number(spec["id"])]
            number = self._answer_id(shape, asked, used, relative=rng.random() < 0.5)
            if number is not None:
                spec["replies"] = {self.words.name(taken): self._reply(shape, maker, number)}
        plain = shape.kind != "marked" and shape.bus == "master_slave" and "echo" not in str(shape.frame)
        if plain and rng.random() < 0.5:
            self._dialogue(shape, maker, found, used)

    def _dialogue(self, shape: Shape, maker: FieldMaker, found: Doc, used: set[tuple[str, int]]) -> None:
        """Let one command be a dialogue of several frames."""
        rng = self.rng
        fit = [each for each in found["commands"].values() if self._may_have_steps(each)]
        if not fit or "response" in found.get("defaults", {}):  # one number of all answers
            return
        command = rng.choice(fit)
        taken = {"request", "response", *found.get("replies", {}), *command.get("replies", {})}
        sent = [name for name, each in found["messages"].items() if each.get("direction") == "response"]
        steps = [{"send": "request"}] if rng.random() < 0.3 else []
        keys = [rng.choice(("send", "receive", "receive")) for _ in range(rng.randint(1, 4))]
        for key in [*keys, "receive"]:
            if key == "receive" and sent and rng.random() < 0.3:
                steps.append({key: rng.choice(sent)})
                continue
            step = self._step(shape, maker, command, key, used)
            if step is not None and rng.random() < 0.5:
                step = {"name": self.words.name(taken), **step}
            steps += [self._described(step)] if step is not None else []
        self._last(command, steps)
        if any("receive" in step for step in steps):
            command["steps"] = steps
            varies = shape.has_length and not shape.trimmed and not shape.least and not shape.groups
            varies = varies and shape.word <= 1
            if varies and shape.most > 8 and "separator" not in command:
                self._size_from_step(steps)
        elif "response" not in command:
            command["response"] = "none"

    @staticmethod
    def _may_have_steps(command: Doc) -> bool:
        addressed = command.get("addressing", "node") == "node"
        one = "many" not in command and command.get("in_flight", 1) == 1
        return addressed and one and command["response"] != "none"

    def _step(
        self, shape: Shape, maker: FieldMaker, command: Doc, key: str, used: set[tuple[str, int]]
    ) -> Doc | None:
        """A frame with an id of its own, None if none is free."""
        rng = self.rng
        direction = "request" if key == "send" else "response"
        numbers = [shape.number(command["id"])]
        number = self._answer_id(shape, numbers, used, relative=rng.random() < 0.3, direction=direction)
        if number is None:
            return None
        make = maker.texts if "separator" in command else maker.fields
        step: Doc = {key: {"id": number, "fields": make(Room.of(shape))}}
        if "separator" in command and random.Random(repr(rng.getstate())).random() < 0.4:
            step[key]["separator"] = "|" if command["separator"] != "|" else ";"
        return step | ({"within": rng.choice(("20 ms", "5 bytes"))} if rng.random() < 0.3 else {})

    def _last(self, command: Doc, steps: list[Doc]) -> None:
        """Put the response of a command at its place among the steps, or leave it out."""
        response = command["response"]
        short = isinstance(response, dict) and not response.keys() & {"id", "fields", "means"}
        if short and self.rng.random() < 0.4:
            del command["response"]
            steps.append({"receive": response})
        elif self.rng.random() < 0.5:
            steps.append({"receive": "response"})
        elif any("receive" in step for step in steps):
            del command["response"]

    def _told_by_request(
        self, shape: Shape, maker: FieldMaker, found: Doc, seen: tuple[set[tuple[str, int]], set[str]]
    ) -> None:
        """Give all answers one number, often, and perhaps that of another reply too."""
        used, taken = seen
        answered = [each for each in found["commands"].values() if each["response"] != "none"]
        if len(answered) < 2 or not shape.shares or self.rng.random() < 0.2:
            return
        number = self._answer_id(shape, [], used, relative=False)
        if number is None:
            return
        found["defaults"] = {"response": {"id": number}}
        if self.rng.random() < 0.4:
            reply = self._reply(replace(shape, most=shape.most - 1), maker, number)
            if any(isinstance(each, dict) and "optional" in each for each in reply["fields"].values()):
                return
            # A byte at its end tells it from answers without one, by its size or by its number.
            reply["fields"]["told"] = {"type": "u8", "const": self.rng.choice((0, 1, 0xA5))}
            self.rng.choice(answered)["replies"] = {self.words.name(taken): reply}

    def _picked(self, shape: Shape, maker: FieldMaker, found: Doc) -> None:
        """Replies picked by a value of the part with the direction, for all commands or for one."""
        taken = {*found["commands"], *found.get("messages", {}), *found.get("replies", {})}
        taken |= {name for spec in found["commands"].values() for name in spec.get("replies", {})}
        steps = (step for spec in found["commands"].values() for step in spec.get("steps", ()))
        taken |= {step["name"] for step in steps if "name" in step}
        for way in shape.ways:
            reply = {"if": {"way": way}, "fields": maker.fields(Room.of(shape))}
            owner = found if self.rng.random() < 0.6 else self.rng.choice(list(found["commands"].values()))
            if owner is found or owner.get("response") != "none":
                owner.setdefault("replies", {})[self.words.name(taken | {"request", "response"})] = reply

    def _more_of(self, shape: Shape, command: Doc) -> None:
        """Several answers, or one of a size that the request says."""
        rng = self.rng
        if rng.random() < 0.2:
            command["many"] = rng.choice(({"count": rng.randint(1, 9)}, {"within": "20 ms"}))
            lists = [name for name, spec in command["request"].items() if _lists(spec)]
            if lists and shape.address_bits and rng.random() < 0.5:
                command["many"] = {"each": f"request.{rng.choice(lists)}"}
        varies = shape.has_length and not shape.trimmed and not shape.least and shape.word <= 1
        if varies and shape.most > 8 and rng.random() < 0.8:
            self._size_from_request(command, rows=not shape.groups)

    def _size_from_request(self, command: Doc, *, rows: bool) -> None:
        """Let a field of the request say how many items the response has."""
        request, rng = command["request"], self.rng
        plain = [name for name, spec in request.items() if re.fullmatch(r"[ui](?!1$)\d+", str(spec))]
        if plain and "empty_request" not in command:
            name, kind = rng.choice(plain), rng.choice(("u8", "i16", "bytes", "text"))
            unsigned = request[name].replace("i", "u")
            request[name] = {"type": unsigned, "range": rng.choice(("0..2", "1..3", "2..3"))}
            value = self.words.name(set())
            command["response"] = {value: f"{kind}[request.{name}]"}
            if rows and rng.random() < 0.5:
                command["response"] = self._row_from_request(value, name)

    def _size_from_step(self, steps: list[Doc]) -> None:
        """Let a field of a step say how many items the last answer has, where that is a step too."""
        rng = self.rng
        last = [step for step in steps if "receive" in step][-1]
        sent = [step for step in steps[: steps.index(last)] if step.get("send", "request") != "request"]
        if not sent or isinstance(last["receive"], str) or rng.random() < 0.3:
            return
        step, name, value = rng.choice(sent), self.words.name(set()), self.words.name(set())
        place = step.get("name", f"step_{steps.index(step) + 1}")
        bounds = rng.choice(("0..2", "1..3", "2..3"))
        step["send"]["fields"] = {name: {"type": rng.choice(("u8", "u16")), "range": bounds}}
        fields = {value: f"{rng.choice(('u8', 'i16', 'bytes', 'text'))}[{place}.{name}]"}
        last["receive"] = {**last["receive"], "fields": fields} if "id" in last["receive"] else fields

    def _row_from_request(self, value: str, asked: str) -> Doc:
        """A row of bits whose bytes alone are counted."""
        rng = self.rng
        size = {"type": rng.choice(("u8", "u16", "i16")), "counts": value, "counts_in": "bytes"}
        kind = rng.choice(("bool", "bool", "u3", "i5", "u8"))
        row: Doc = {"type": f"{kind}[request.{asked}]", "packed": rng.choice(("least", "most"))}
        if kind == "u3" and rng.random() < 0.5:
            row["range"] = "0..6"
        return {self.words.name({value}): size, value: row}

    def _answer_id(
        self,
        shape: Shape,
        asked: list[int],
        used: set[tuple[str, int]],
        *,
        relative: bool,
        direction: str = "response",
    ) -> int | Doc | str | None:
        """A number for the answers to requests that no other message has."""
        top = (1 << shape.id_bits) - 1
        for _ in range(20):
            number = self.rng.randint(-top if relative else 0, top)
            number = number if relative else shape.fit(number)
            numbers = {number + each for each in asked} if relative else {number}
            taken = {(direction, each) for each in numbers}
            if not taken & used and all(0 <= each <= top and each != shape.end_id for each in numbers):
                used |= taken
                if not relative:
                    return shape.id(number)
                return f"request.id {'-' if number < 0 else '+'} {abs(number):#x}"
        return None

    def _reply(self, shape: Shape, maker: FieldMaker, number: int | Doc | str) -> Doc:
        rng = self.rng
        fields = maker.fields(Room.of(shape))
        reply: Doc = {"id": number, "fields": fields}
        if means := self._means(fields):
            reply["means"] = means
        elif rng.random() < 0.5:
            reply["means"] = rng.choice(_MEANS)
        return self._described(reply)

    def _means(self, fields: Doc) -> Doc:
        """What one of the fields decides, or nothing."""
        rng = self.rng
        plain = [name for name, spec in fields.items() if spec in ("u8", "u16")]
        if not plain or rng.random() < 0.5:
            return {}
        cases = {rng.choice((0, 1, "2..9", 100)): rng.choice(_MEANS) for _ in range(2)}
        return {"switch": rng.choice(plain), "cases": cases, "default": rng.choice(_MEANS)}

    def _response(self, shape: Shape, maker: FieldMaker, request: Doc) -> Doc:
        echoes: Doc = {}
        plain = [
            name for name, spec in request.items() if isinstance(spec, str) and re.fullmatch(r"[ui]\d+", spec)
        ]
        if plain and shape.kind != "packet" and self.rng.random() < 0.3:
            name = self.rng.choice(plain)
            echoes[name] = {"type": request[name], "echo": True}
            if self.rng.random() < 0.5 and name not in str(shape.frame):
                echoes = {self.words.name({name}): {"type": request[name], "equals": f"request.{name}"}}
        if shape.kind != "packet" and self.rng.random() < 0.2:
            self._repeat_part(shape, request, echoes)
        return maker.fields(Room.of(shape), echoes)

    def _repeat_part(self, shape: Shape, request: Doc, echoes: Doc) -> None:
        """Repeat a piece of the id of the request, or its address."""
        parts = [] if shape.text_id else list(shape.pieces)
        if shape.kind != "marked" and shape.address_bits:
            parts.append((shape.address_name, shape.address_bits))
        parts = [(name, bits) for name, bits in parts if name not in request and bits <= 64]
        if parts:
            name, bits = self.rng.choice(parts)
            kind = f"u{self.rng.choice([each for each in (8, 16, 24, 32, 64) if each >= bits])}"
            taken = {*shape.attributes, *echoes}
            echoes[self.words.name(taken)] = {"type": kind, "equals": f"request.{name}"}

    def _message(self, shape: Shape, maker: FieldMaker, kinds: str, *, texts: bool = False) -> Doc:
        message: Doc = self._identified(shape)
        direction = "request" if shape.kind == "packet" else self.rng.choice(("request", "response", None))
        if shape.directed:
            direction = direction or "request"
        if direction and kinds != "undirected":
            message["direction"] = direction
        if texts or (self._separable(shape) and self.rng.random() < 0.3):
            separator = self.rng.choice((",", {"before": ","}))
            return self._described(message | {"separator": separator, "fields": maker.texts(Room.of(shape))})
        return self._described(message | {"fields": maker.fields(Room.of(shape))})

    def _separable(self, shape: Shape) -> bool:
        """Whether the frame allows texts between separators."""
        varies = shape.has_length and not shape.trimmed and not shape.least and shape.word <= 1
        return varies and shape.kind not in ("marked", "packet") and not shape.groups

    def _described(self, spec: Doc) -> Doc:
        if self.rng.random() < 0.6:
            spec["doc"] = self.words.text()
        if self.rng.random() < 0.4:
            spec["section"] = "user's guide" if self.hostile else "7.10"
        return spec

    def _identified(self, shape: Shape) -> Doc:
        """The id of a message, if the frame has one; of several pieces the first is the most significant."""
        if shape.id_bits == 0:
            return {}
        return {"id": shape.id(self._id(shape))}

    def _id(self, shape: Shape) -> int:
        """A unique number, often the stuffed byte or a bound."""
        top = (1 << shape.id_bits) - 1
        while True:
            likely = (
                0,
                top,
                shape.mark,
                top // 2 + 1,
                self.rng.randint(0, top),
                self.rng.randint(0, min(top, 40)),
            )
            number = shape.fit(self.rng.choice([each for each in likely if each <= top]))
            if number not in self._ids and number != shape.end_id:
                self._ids.add(number)
                return number


def _refuse_shortly(rng: random.Random, several: Kinds, found: Doc) -> None:
    """Let a message without an id be a reply of all commands, perhaps."""
    answered = [each for each in found["commands"].values() if each["response"] != "none"]
    used = {each["response"] for each in answered if isinstance(each["response"], str)}
    used |= {step.get("receive") for each in answered for step in each.get("steps", ()) if "receive" in step
             and isinstance(step["receive"], str)}  # fmt: skip
    short = {each.name for each in several.families if not each.shape.id_bits and not each.shape.most}
    for name, spec in list(found["messages"].items()):
        if answered and name not in used and spec.get("frame") in short and rng.random() < 0.6:
            del found["messages"][name]
            kept = {key: spec[key] for key in ("frame", "fields", "doc") if key in spec}
            found["replies"] = {**found.get("replies", {}), name: kept}


def _lists(spec: object) -> bool:
    """Whether a field may be a list of nodes."""
    kind = spec.get("type") if isinstance(spec, dict) and spec.keys() <= {"type", "doc", "section"} else spec
    return re.match(r"(u\d+|bytes)\[[1-9]", str(kind)) is not None


def _stop_answers(rng: random.Random, document: Doc) -> None:
    """Let another command stop the answers to one, in some schemas."""
    commands: Doc = document.get("commands", {})
    if (
        document["bus"]["kind"] not in {"master_slave", "link"}
        or "packet" in document.get("frame", {})
        or "defaults" in document
        or rng.random() < 0.5
    ):
        return
    plain = {
        name: each for name, each in commands.items() if not each.keys() & {"many", "steps", "in_flight"}
    }
    stops = {name: each for name, each in plain.items() if each["request"] == {}}
    begin = [name for name, each in plain.items() if each["response"] != "none"]
    pairs = [(a, b) for a in begin for b in stops if a != b and _may_stop(plain[b], plain[a])]
    if pairs:
        name, stop = rng.choice(pairs)
        commands[name]["many"] = {"until": stop} | ({"within": "40 ms"} if rng.random() < 0.5 else {})


def _may_stop(stop: Doc, begun: Doc) -> bool:
    """Whether the request of one command can stop the answers to another one."""
    to_all = begun.get("addressing") == "answered_broadcast" and stop.get("addressing") == "node"
    same = all(stop.get(key) == begun.get(key) for key in ("from", "frame"))
    return same and begun.get("addressing") != "either" and not to_all


def _begin_with_break(rng: random.Random, document: Doc) -> None:
    """Let a break begin the frames that a silence ends, in some schemas."""
    parts: Doc = document.get("frame", {}).get("parts", {})
    name = next(
        (name for name, spec in parts.items() if isinstance(spec, dict) and spec.get("role") == "idle"), ""
    )
    if not name or "to_unknown" in document or rng.random() < 0.6:
        return
    answered = any(spec.get("response") != "none" for spec in document.get("commands", {}).values())
    if not (parts[name].get("alone") and answered):
        first = {name: parts.pop(name) | {"role": "break"}}
        document["frame"]["parts"] = first | parts


def _link(rng: random.Random, document: Doc) -> None:
    """Let the bus be a link, whose sides the directed messages name."""
    bus = document["bus"]
    bus |= {"kind": "link", "sides": ["host", "device"]}
    low, high = whole_span(bus.get("nodes", "0..0"))
    if not low <= int(bus.get("master", low)) <= high:
        del bus["master"]
    for spec in document.get("messages", {}).values():
        if "direction" in spec:
            spec["from"] = {"request": "host", "response": "device"}[spec.pop("direction")]
    commands = document.get("commands", {}).values()
    if _passed_over(document) and all(spec.get("response", "none") == "none" for spec in commands):
        for spec in commands:
            spec["from"] = rng.choice(("host", "device", "either"))


def _passed_over(document: Doc) -> bool:
    """Whether a receiver of one direction passes over the frames of the other, as both sides need to ask."""
    parts = document.get("frame", {}).get("parts", {}).values()
    specs = [spec for spec in parts if isinstance(spec, dict)]
    ended = any("counts" in spec or spec.get("role") == "terminator" for spec in specs)
    checks = [spec["over"] for spec in specs if "algorithm" in spec]
    seeded = any(str(each).startswith("attribute.") for over in checks for each in over)
    plain = "to_unknown" not in document and not any("if" in spec for spec in specs)
    return ended and bool(checks) and not seeded and plain


def _usual_kind(rng: random.Random, document: Doc) -> None:
    """State the kind of frame of some commands and messages under defaults, where all state one."""
    groups = ("commands", "messages", "replies")
    specs = [spec for group in groups for spec in document.get(group, {}).values()]
    if any("frame" not in spec for spec in specs):
        return
    kind = rng.choice([spec["frame"] for spec in specs])
    document.setdefault("defaults", {})["frame"] = kind
    for group in ("commands", "messages"):
        for spec in document.get(group, {}).values():
            if spec["frame"] == kind and rng.random() < 0.7:
                del spec["frame"]


def _name_parts(rng: random.Random, document: Doc) -> None:
    """Write bits with roles as a named type, in some schemas; its part may have keys of its own."""
    parts: Doc = document["frame"].get("parts", {})
    for name, spec in parts.items():
        if not isinstance(spec, dict) or "'role'" not in str(spec.get("bits")) or rng.random() < 0.6:
            continue
        own = {key: spec[key] for key in ("if", "byteorder") if key in spec}
        kind = {key: each for key, each in spec.items() if key not in own}
        document.setdefault("types", {})["head_type"] = kind
        parts[name] = {**own, "type": "head_type"} if own or rng.random() < 0.5 else "head_type"


# YAML


def dump(document: Doc) -> str:
    """A schema as readable YAML; ambiguous scalars are quoted."""
    return "\n".join(_lines(document, 0)) + "\n"


def _lines(mapping: Doc, depth: int) -> Iterable[str]:
    for key, value in mapping.items():
        front = f"{'  ' * depth}{_flow(key)}:"
        if isinstance(value, dict) and value and depth < _BLOCKS:
            yield front
            yield from _lines(value, depth + 1)
        else:
            yield f"{front} {_flow(value)}"


def _flow(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value if _PLAIN.match(value) and value not in _YAML_WORDS else _quoted(value)
    return str(value)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
