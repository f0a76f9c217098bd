"""The catalogue compared with two independent libraries, and the algebra that generated code uses."""

from __future__ import annotations

import binascii
import pickle
import subprocess
import sys
import zlib

import anycrc
import pytest
from crccheck import crc as crccheck
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.errors import QlinkgenError
from qlinkgen.model import checksum
from qlinkgen.model.checksum import Algorithm, Sum, UnknownAlgorithm, catalogue, find

CHECK_DATA = b"123456789"
ALL = catalogue()
every_algorithm = pytest.mark.parametrize("algorithm", ALL, ids=lambda each: each.name)

CRCCHECK = {each._names[0].lower(): each for each in crccheck.ALLCRCCLASSES}
PARAMETERS = {
    "width": "_width",
    "poly": "_poly",
    "init": "_initvalue",
    "refin": "_reflect_input",
    "refout": "_reflect_output",
    "xorout": "_xor_output",
    "check": "_check_result",
}
ANYCRC = {each.name: each.name.upper().replace("CRC-", "CRC").replace("/", "-") for each in ALL}
SAMPLES = [b"", b"\x00", b"\xa5" * 5, bytes(range(256)), CHECK_DATA]


def crc(name: str) -> Algorithm:
    found = find(name)
    assert isinstance(found, Algorithm)
    return found


def bitwise(algorithm: Algorithm, data: bytes) -> int:
    """The definition taken literally: one unreflected register, one bit at a time."""
    register = algorithm.init
    for byte in data:
        bits = f"{byte:08b}"
        for bit in reversed(bits) if algorithm.refin else bits:
            high = register >> (algorithm.width - 1)
            register = register << 1 & algorithm.mask
            register ^= algorithm.poly if high ^ int(bit) else 0
    if algorithm.refout:
        register = int(f"{register:0{algorithm.width}b}"[::-1], 2)
    return register ^ algorithm.xorout


def test_the_catalogue_is_complete() -> None:
    # crccheck has one more, of 82 bits, which neither anycrc nor 64-bit registers support.
    assert {each.name for each in ALL} == set(CRCCHECK) - {"crc-82/darc"}
    assert set(ANYCRC.values()) == set(anycrc.models)
    assert [len(catalogue(width)) for width in (8, 16, 32, 64)] == [20, 31, 12, 7]
    assert catalogue(9) == ()
    assert sorted(ALL, key=lambda each: (each.width, each.name)) == list(ALL)


@every_algorithm
def test_parameters_agree_with_crccheck_and_anycrc(algorithm: Algorithm) -> None:
    peer = CRCCHECK[algorithm.name]
    ours = {name: getattr(algorithm, name) for name in PARAMETERS}
    assert ours == anycrc.models[ANYCRC[algorithm.name]]._asdict()
    assert ours == {name: getattr(peer, theirs) for name, theirs in PARAMETERS.items()}


@every_algorithm
def test_values_agree_with_crccheck_and_anycrc(algorithm: Algorithm) -> None:
    assert algorithm.compute(CHECK_DATA) == algorithm.check
    for data in SAMPLES:
        assert algorithm.compute(data) == CRCCHECK[algorithm.name].calc(data) == bitwise(algorithm, data)
        if data:  # without data anycrc returns the unreflected init
            assert algorithm.compute(data) == anycrc.Model(ANYCRC[algorithm.name]).calc(data)


@given(st.sampled_from(ALL), st.binary())
def test_values_agree_for_any_data(algorithm: Algorithm, data: bytes) -> None:
    assert algorithm.compute(data) == bitwise(algorithm, data)


@given(st.binary())
def test_values_agree_with_the_standard_library(data: bytes) -> None:
    assert crc("crc-16/ibm-3740").compute(data) == binascii.crc_hqx(data, 0xFFFF)
    assert crc("crc-32").compute(data) == zlib.crc32(data)


@given(st.sampled_from(ALL), st.binary(max_size=20), st.data())
def test_before_undoes_register(algorithm: Algorithm, prefix: bytes, data: st.DataObject) -> None:
    value = data.draw(st.integers(0, algorithm.mask))
    assert algorithm.register(prefix, algorithm.before(prefix, value)) == value
    assert algorithm.before(prefix, algorithm.register(prefix, value)) == value


@every_algorithm
def test_a_constant_preamble_folds_into_the_start_value(algorithm: Algorithm) -> None:
    folded = algorithm.before(b"\xa5\xa5", algorithm.start)
    register = algorithm.register(b"\xa5\xa5" + CHECK_DATA, folded)
    assert algorithm.finish(register) == algorithm.check


# The index of an unreflected table needs as many register bits as input bits.
@pytest.mark.parametrize("algorithm", [each for each in ALL if each.width >= 4], ids=lambda each: each.name)
def test_a_table_of_16_entries_gives_the_same_values(algorithm: Algorithm) -> None:
    small, register = algorithm.table(4), algorithm.start
    assert len(small) == 16
    for byte in CHECK_DATA:
        if algorithm.refin:
            register = register >> 4 ^ small[(register ^ byte) & 15]
            register = register >> 4 ^ small[(register ^ byte >> 4) & 15]
        else:
            shift = algorithm.width - 4
            register = register << 4 & algorithm.mask ^ small[register >> shift ^ byte >> 4]
            register = register << 4 & algorithm.mask ^ small[register >> shift ^ byte & 15]
    assert algorithm.finish(register) == algorithm.check


def test_tables_as_printed_elsewhere() -> None:
    assert crc("crc-16/ibm-3740").table()[:4] == (0x0000, 0x1021, 0x2042, 0x3063)
    assert crc("crc-32").table()[1:3] == (0x77073096, 0xEE0E612C)
    assert len(crc("crc-32").table()) == 256


@pytest.mark.parametrize(
    ("name", "canonical"),
    [
        ("crc-16/ibm-3740", "crc-16/ibm-3740"),
        ("CRC-16/CCITT-FALSE", "crc-16/ibm-3740"),
        ("crc16_ccitt_false", "crc-16/ibm-3740"),
        ("ccitt-false", "crc-16/ibm-3740"),
        ("crc-16/autosar", "crc-16/ibm-3740"),
        ("modbus", "crc-16/modbus"),
        ("x-25", "crc-16/ibm-sdlc"),
        ("x25", "crc-16/ibm-sdlc"),
        ("crc-16", "crc-16/arc"),
        ("crc-32", "crc-32/iso-hdlc"),
        ("crc-32c", "crc-32/iscsi"),
        ("sum16", "sum16"),
    ],
)
def test_names_and_aliases(name: str, canonical: str) -> None:
    assert find(name).name == canonical


AMBIGUOUS = [
    "crc16-ccitt",
    "CRC-CCITT",
    "crc_16_ccitt",
    "ccitt",
    "CRC16",
    "crc-16",
    "crc-ibm",
    "crc8",
    "crc-8",
]
AMBIGUOUS += ["crc24", "crc-32", "CRC32", "crc_64"]


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_names_that_are_used_for_several_algorithms(name: str) -> None:
    found = checksum.candidates(name)
    assert find(name) in found
    assert len({each.check for each in found}) == len(found) >= 3
    assert len({each.width for each in found}) == 1


def test_all_other_names_are_clear() -> None:
    keys = {checksum._key(name) for name in AMBIGUOUS}
    assert keys == set(checksum._AMBIGUOUS)
    for each in ALL:
        for name in each.names:
            assert bool(checksum.candidates(name)) is (checksum._key(name) in keys), name
        assert not checksum.candidates(each.name)  # the proposed name gives no warning


def test_every_name_finds_its_own_algorithm() -> None:
    everything: tuple[checksum.Checksum, ...] = (*checksum.SUMS, *ALL)
    names = [(name, each) for each in everything for name in each.names]
    assert all(find(name) is each for name, each in names)
    assert len({checksum._key(name) for name, _ in names}) == len(names)
    assert all(name == name.lower().strip() for name, _ in names)


@pytest.mark.parametrize(
    ("name", "suggestion"),
    [
        ("crc-16/ibm-3470", "crc-16/ibm-3740"),
        ("modbuss", "modbus"),
        ("sum-61", "sum16"),
        ("autosar", "crc-8/autosar"),  # a part of three names
        ("autosar", "crc-32/autosar"),
    ],
)
def test_an_unknown_name_comes_with_suggestions(name: str, suggestion: str) -> None:
    with pytest.raises(UnknownAlgorithm, match=r"unknown checksum algorithm .*; did you mean") as caught:
        find(name)
    assert suggestion in caught.value.suggestions
    assert isinstance(caught.value, LookupError)
    assert isinstance(caught.value, QlinkgenError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_hopeless_name_has_no_suggestions() -> None:
    with pytest.raises(UnknownAlgorithm) as caught:
        find("§")
    assert caught.value.suggestions == ()


@given(st.binary())
def test_sums(data: bytes) -> None:
    assert find("sum8").compute(data) == sum(data) % 256
    assert find("sum16").compute(data) == sum(data) % 65536
    assert find("sum8-inverted").compute(data) == 255 - sum(data) % 256


def test_a_sum_adds_whatever_units_it_is_given() -> None:
    # The example of the MC1231A manual: command 11 hex with data FEDC BA98.
    assert find("sum16").compute([0x11, 0xFEDC, 0xBA98]) == 0xB985
    # A Dynamixel 1.0 ping of servo 1: id, length, instruction.
    assert find("sum8-inverted").compute(b"\x01\x02\x01") == 0xFB
    assert isinstance(find("sum8"), Sum)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 2}, "width is 2"),
        ({"width": 65}, "width is 65"),
        ({"poly": 0x1020}, "poly must be odd"),
        ({"poly": 0x11021}, "poly does not fit"),
        ({"init": -1}, "init does not fit"),
        ({"xorout": 0x10000}, "xorout does not fit"),
    ],
)
def test_impossible_parameters_are_refused(changes: dict[str, int], message: str) -> None:
    parameters = {"width": 16, "poly": 0x1021, "init": 0, "xorout": 0, "check": 0} | changes
    with pytest.raises(ValueError, match=message):
        Algorithm("mine", refin=False, refout=False, aliases=(), **parameters)


def test_importing_the_module_reads_no_catalogue() -> None:
    code = "import qlinkgen.model.checksum as c; assert c._catalogue.cache_info().currsize == 0"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_at_most_three_names_are_meant() -> None:
    with pytest.raises(UnknownAlgorithm) as caught:
        find("crc-16/cm")
    assert caught.value.suggestions == ("crc-16/cms", "crc-16", "crc-16/gsm")


KNOWN = {
    "sum8": 0xDD,
    "sum8-inverted": 0x22,
    "sum8-zero": 0x23,
    "sum8-carry": 0xDE,
    "sum8-carry-inverted": 0x21,
    "xor8": 0x31,
    "xor16": 0x0839,
    "sum16": 0x01DD,
    "sum16-inverted": 0xFE22,
    "sum16-zero": 0xFE23,
    "sum32": 0x01DD,
    "fletcher-8": 0x15DD,
    "fletcher-16": 0x1EDE,
    "adler-32": 0x091E01DE,
}


def test_known_values_of_what_is_not_a_crc() -> None:
    assert {each.name: each.check for each in checksum.SUMS} == KNOWN
    assert find("fletcher-16").compute(b"abcde") == 0xC8F0
    assert find("adler").compute(b"Wikipedia") == 0x11E60398
    # ModbusASCII, :010300000002 FA; UBX poll of MON-VER, B5 62 0A 04 00 00 0E 34.
    assert find("sum8-zero").compute(bytes.fromhex("010300000002")) == 0xFA
    # The example of the LIN specification 2.1, 2.8.3.
    assert find("sum8-carry-inverted").compute(bytes.fromhex("4A5593E5")) == 0xE6
    assert find("fletcher-8").compute(bytes.fromhex("0A040000")).to_bytes(2, "little").hex() == "0e34"


@given(data=st.binary(max_size=200))
def test_a_register_takes_bytes_one_by_one(data: bytes) -> None:
    for each in (*checksum.SUMS, *ALL):
        register = each.start
        for byte in data[:20]:
            register = each.step(register, byte)
        assert each.finish(register) == each.compute(data[:20]), each.name
    assert find("adler-32").compute(data) == zlib.adler32(data)


def test_a_crc_by_its_parameters() -> None:
    smbus = checksum.stated(8, 0x07, 0, refin=False, refout=False, xorout=0)
    assert smbus is find("crc-8/smbus")
    own = checksum.stated(16, 0x1021, 0xABCD, refin=True, refout=False, xorout=1)
    assert own.name == "crc-16/poly-1021"
    assert own.check == own.compute(CHECK_DATA) == bitwise(own, CHECK_DATA)
    with pytest.raises(ValueError, match="poly must be odd"):
        checksum.stated(8, 0x8C ^ 0x8E, 0, refin=False, refout=False, xorout=0)


def test_words_for_several_sums_are_no_algorithm() -> None:
    for name in checksum._UNNAMED:
        with pytest.raises(UnknownAlgorithm) as caught:
            find(name)
        assert caught.value.suggestions == tuple(each.name for each in checksum.candidates(name))
        assert len(caught.value.suggestions) >= 2


def test_another_start() -> None:
    assert checksum.begun(find("crc-16/modbus"), 0) is find("crc-16/arc")
    assert checksum.begun(find("crc-16/modbus"), 0xFFFF) is find("crc-16/modbus")
    own = checksum.begun(find("crc-16/modbus"), 0x1234)
    assert isinstance(own, Algorithm)
    assert (own.name, own.check) == ("crc-16/modbus/init-1234", bitwise(own, CHECK_DATA))
    for name, init, value in (("sum8-zero", 5, 0x1E), ("xor8", 0xFF, 0xCE), ("fletcher-8", 0x0100, 0x16DD)):
        assert checksum.begun(find(name), init).check == value
    with pytest.raises(ValueError, match="init does not fit into 8 bits"):
        checksum.begun(find("sum8"), 256)


def test_a_start_of_fletcher_is_that_of_its_residues() -> None:
    """So that empty data has the same value in every implementation."""
    assert checksum.begun(find("fletcher-16"), 0xFFFF) == find("fletcher-16")
    assert checksum.begun(find("adler-32"), 0xFFFFFFFF).init == zlib.adler32(b"", 0xFFFFFFFF)
