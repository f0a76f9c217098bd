"""Programs that cannot be read: one error, with its place and what to do."""

from __future__ import annotations

import pickle
import string

import pytest

from qlinkgen.protocols.trio.basic import BasicError, parse
from qlinkgen.protocols.trio.basic.expression_parser import DEEPEST
from qlinkgen.protocols.trio.basic.lexer import WORDS


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("PRNT #10", "1:1: unknown word 'prnt'; did you mean PRINT?"),
        ("a=1\r\n  MOVE(10)", "2:3: unknown word 'move'"),
        ("a=lenght\nlength=2", "1:3: 'lenght' is neither a word nor a variable; did you mean length?"),
        ("GOTO begn\nbegin: STOP", "1:6: no label 'begn'; did you mean begin?"),
        ("x: STOP\nX: STOP", "2:1: label 'x' is there twice; rename one of them"),
        ("GOTO 10", "1:6: found '10'; GOTO needs the name of a label"),
        ("THEN", "1:1: found 'THEN'; a statement begins with a word such as PRINT, or a variable"),
        ("STOP STOP", "1:6: found 'STOP'; expected ':' before another statement, or the end of the line"),
        ("IF 1 GOTO x", "1:6: found 'GOTO'; expected THEN after the condition"),
        ("IF 1 THEN\nSTOP", "1:10: found the end of the line; expected a statement after THEN or ELSE"),
        ("IF 1 THEN STOP ELSE", "1:20: found the end of the line; expected a statement after THEN or ELSE"),
        ("IF 1 THEN REPEAT\nUNTIL 1", "1:1: REPEAT and UNTIL are not both in one part of the IF"),
        ("UNTIL 1", "1:1: UNTIL without REPEAT; begin the loop with REPEAT, or write WAIT UNTIL"),
        ("a=1\nREPEAT", "2:1: REPEAT without UNTIL"),
        ("WAIT 1", "1:6: found '1'; expected UNTIL after WAIT"),
        ("WA(1,2)", "1:1: WA has 2 arguments; write WA(milliseconds)"),
        ("SEND(10,2)", "1:1: SEND has 2 arguments; write SEND(n, type, data1[, data2])"),
        ("DEFKEY(1)", "1:1: DEFKEY has no values; write DEFKEY(key, value, value, ...)"),
        ("PRINT \"x\"", "1:7: found the text 'x'; expected '#'"),
        ('PRINT #10,"x",', "1:15: found the end of the line; expected a number, a variable or '('"),
        ("PRINT #10,CHR(1,2)", "1:17: CHR has 2 arguments; write CHR(number)"),
        ("PRINT #10,1[2", "1:14: found the end of the line; expected ']'"),
        ('PRINT #10,"x', '1:11: text without its end; close it with " on the same line'),
        ('PRINT #10,"\u00e9"', "1:11: text contains '\u00e9'; write characters from blank to ~"),
        ('PRINT #10,"\x1b[2J"', r"1:11: text contains '\x1b'"),
        ("a=\u20142", "1:3: unknown character '\u2014'"),
        ("GET #3,4", "1:8: found '4'; expected a variable, such as VR(0)"),
        ("a=1+", "1:5: found the end of the line; expected a number, a variable or '('"),
        ("a=1e999", "1:3: the number is too large; keep it below 1e308"),
        ("a=" + "(" * 5000, f"more than {DEEPEST} levels inside one another"),
        ("a=" + "-" * 5000 + "1", f"more than {DEEPEST} levels inside one another"),
        ("a=" + "NOT " * 5000 + "1", f"more than {DEEPEST} levels inside one another"),
        ("IF 1 THEN " * 5000 + "STOP", f"more than {DEEPEST} levels inside one another"),
    ],
)  # fmt: skip
def test_the_first_fault_is_told(text: str, error: str) -> None:
    with pytest.raises(BasicError) as caught:
        parse(text, "master.bas")
    assert error in str(caught.value)
    assert str(caught.value).startswith("master.bas:")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.place) == (str(caught.value), caught.value.place)


def test_case_has_no_meaning_and_blanks_separate_no_more_than_needed() -> None:
    program = parse(
        "Loop:if(A=1)AND(a<>2)then goto LOOP:a=VR(1):print#10,a[6.1];'end\n\ta=3 ' no label: here\n"
    )
    assert program.labels == {"loop": 0}
    assert len(program.steps) == 5


def test_lines_end_as_in_any_system() -> None:
    for end in ("\n", "\r\n", "\r"):
        assert [step.place.line for step in parse(end.join(("STOP", "", "STOP"))).steps] == [1, 3]


def test_a_word_is_never_a_name() -> None:
    for word in WORDS:
        assert set(word) <= set(string.ascii_uppercase)
        with pytest.raises(BasicError):
            parse(f"{word}: {word}=1")
