"""Names in the output: converts schema names to identifiers of each language without collisions.

A name that a language, its library or the generated code uses gets a trailing underscore, or its kind as a
suffix (`FaultEnum`, `error_flags`). Lint uses the same functions to find clashes among the results.
"""

from __future__ import annotations

import builtins
import keyword

# Python -----------------------------------------------------------------------------------------------------

#: Methods of every message, and their first parameter.
_METHODS = frozenset(
    """to_frame to_bytes from_bytes from_checked measure_payload to_after take_after self
    cls""".split()  # noqa: SIM905 - reads better than quoted words
)
#: Types and decorators in the body of a message class, which an address must not hide.
_IN_CLASS = frozenset({"int", "bytes", "classmethod"})
#: Names in the functions that take an address as an argument.
_IN_FUNCTIONS = frozenset(
    """as_bytes bytes cls data frame head illegal len message number payload struct_error
    wrong_size""".split()  # noqa: SIM905 - reads better than quoted words
)
#: Attributes of the classes of calls and handlers, and of those in `qlinkgen.bus`; types of arguments.
_IN_CALLS = frozenset(
    """ask ask_any ask_each ask_many ask_steps ask_stream tell handle number axis bool bytes dict float int
    list str tuple type accepts after_fork bus close codec engine iterate logger node on_event on_frame open
    poll port run serve stream transact transaction usual_echo watch""".split()  # noqa: SIM905
)
#: Further attributes of the classes of ring nodes in `qlinkgen.bus`.
_IN_RING_CALLS = frozenset(
    """clear_netstat commserror counters driver engine flush netstat now receive sleep transmit tx_timeout
    wait_until""".split()  # noqa: SIM905
)
#: Classes, constants and imports of a codec, and constants in the body of a message class.
_IN_MODULE = frozenset(
    """Message Request Response StreamDecoder Command Counters Fault CodecError EncodeError DecodeError
    Codec Bus OpenEnum BaseMessage ArrayRule BytesRule ConstantRule CountRule IntRule MaskRule
    ScaledRule TextRule RecordRule RecordsRule BaseRecord MaybeRule Misplaced NEW Rule OutOfRange Scale
    DecimalScale Marking Resync Struct Decimal Self Any Callable Generator AsyncGenerator Iterable Sequence
    BytesLike ClassVar Final Literal LayoutError EachOf UntilStopped
    Checksum BUS BREAK COMMANDS MESSAGES RECORDS MARKING RESYNC REFUSALS UNREAD UNREADABLE NAME ID FIELDS
    RULES ADDRESS EMPTY CHECKED""".split()  # noqa: SIM905
) | frozenset(dir(builtins))


def attribute(name: str) -> str:
    """The attribute of a field, and the argument for it."""
    return f"{name}_" if keyword.iskeyword(name) or name in _METHODS else name


def address_attribute(name: str) -> str:
    """The attribute of an address, which is annotated in the body of the class."""
    return f"{name}_" if name in _IN_CLASS else attribute(name)


def address_argument(name: str) -> str:
    """The address argument of functions that decode a payload."""
    return f"{name}_" if name in _IN_FUNCTIONS else address_attribute(name)


def method(name: str) -> str:
    """The method of a command in the classes of a bus module."""
    return f"{name}_" if name in _IN_CALLS or keyword.iskeyword(name) else name


def ring_method(name: str) -> str:
    """The method of a message in the classes of a bus module of a ring."""
    return f"{name}_" if name in _IN_RING_CALLS else method(name)


def message_class(name: str) -> str:
    """The class of a message."""
    found = pascal(name)
    return f"{found}_" if found in _IN_MODULE else found


def constant_class(name: str, kind: str, messages: frozenset[str]) -> str:
    """The class of an enum or of flags; its kind is appended if a message has the same name."""
    found = pascal(name)
    return f"{found}{pascal(kind)}" if found in messages or found in _IN_MODULE else found


# C ----------------------------------------------------------------------------------------------------------

#: Keywords of C and C++ up to C23 and C++23, those of compilers without -std, and object-like macros of the C
#: library, of GNU compilers and of Windows. Function-like macros expand only before a parenthesis, which
#: never follows a member. In C++ a member cannot have the name of the type of another one.
_C_WORDS = frozenset(
    """alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool
    break case catch char char8_t char16_t char32_t class co_await co_return co_yield compl concept
    const const_cast consteval constexpr constinit continue decltype default delete do double
    dynamic_cast else enum explicit export extern false float for friend goto if import inline int
    long module mutable namespace new noexcept not not_eq nullptr operator or or_eq private
    protected public reflexpr register reinterpret_cast requires restrict return short signed sizeof
    static static_assert static_cast struct switch synchronized template this thread_local throw
    true try typedef typeid typename typeof typeof_unqual union unsigned using virtual void volatile
    wchar_t while xor xor_eq alloca complex errno imaginary linux math_errhandling noreturn stderr
    stdin stdout unix unreachable sa_handler sa_sigaction sigev_notify_attributes
    sigev_notify_function si_addr si_addr_lsb si_arch si_band si_call_addr si_fd si_int si_lower
    si_overrun si_pid si_pkey si_ptr si_status si_stime si_syscall si_timerid si_uid si_upper
    si_utime si_value st_atime st_ctime st_mtime arm mips i386 vax far huge near interface small
    hyper cdecl pascal interrupt""".split()  # noqa: SIM905
) | {f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)}
#: Variables of generated functions with an address parameter, and other members of structs with an address.
_C_LOCALS = frozenset(
    """size payload wire capacity message value from to end check since index sent status id slave master
    listener frame checked request response body buffer start count raw sum crc payload_size
    payload_capacity total trailer covered head place broadcast context byte at direction
    parts received size_t block out turn due step texts length left found ended used extra
    defaults seeds before answers streaming""".split()  # noqa: SIM905
)
#: Members of a table of handlers other than functions.
_C_HANDLERS = frozenset(
    {
        "node",
        "address",
        "before",
        "broadcast",
        "context",
        "id",
        "parts",
        "received",
        "replying",
        "streaming",
        "turn",
        "due",
        "kept",
    }
)
#: Names that the header itself defines, or their beginnings, without the prefix of the protocol.
_C_STEMS = frozenset(
    """addressing async_master_calls async_node_calls bits bits_per bus check codec_error command crc
    decode decode_buffer decode_error direction enable encode_error encode error event event_counts
    fault first frame generator inbox last listener master master_calls max max_frame max_payload
    max_wire message node_calls ok outbox parts protocol real receiver repeat repeat_by request
    response schema slave slave_handlers status stream_decoder without""".split()  # noqa: SIM905
)
#: Types of the C library that may equal a name with the prefix of a protocol.
_C_TYPES = frozenset(
    {
        f"{sign}int_{kind}{bits}_t"
        for sign in ("", "u")
        for kind in ("fast", "least")
        for bits in (8, 16, 32, 64)
    }
    | {"max_align_t", "sig_atomic_t"}
)


def member(name: str) -> str:
    """The member of a struct for a field."""
    return f"{name}_" if name in _C_WORDS else name


def address_member(name: str) -> str:
    """The member and the parameter for an address."""
    return f"{name}_" if name in _C_WORDS | _C_LOCALS | _C_TYPES else name


def handler(name: str, address: str) -> str:
    """The member of a table of handlers for a command or message; ``address`` is the address member."""
    return f"{name}_" if name in _C_WORDS or name in _C_HANDLERS or name == address else name


def stem(protocol: str, name: str, kind: str) -> str:
    """The stem of the names of an enum, flags, type or message, without the prefix of the protocol."""
    taken = name in _C_STEMS or name.startswith("crc_") or f"{protocol}_{name}_t" in _C_TYPES
    return f"{name}_{kind}" if taken else name


# Files ------------------------------------------------------------------------------------------------------

#: Devices of Windows, whose names are not allowed for its files and folders, in any case of letters.
WINDOWS_DEVICES = frozenset(
    """aux con nul prn com1 com2 com3 com4 com5 com6 com7 com8 com9
    lpt1 lpt2 lpt3 lpt4 lpt5 lpt6 lpt7 lpt8 lpt9""".split()  # noqa: SIM905
)
#: Also headers of C and POSIX, and modules that generated ones import.
_FILES = WINDOWS_DEVICES | frozenset(
    """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign
    stdarg stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath
    threads time uchar wchar wctype fcntl poll pthread sched semaphore strings termios unistd""".split()  # noqa: SIM905
)


def file_stem(protocol: str) -> str:
    """The stem of the files of a protocol: headers, modules, vectors."""
    return f"{protocol}_" if protocol in _FILES or keyword.iskeyword(protocol) else protocol


# Records ----------------------------------------------------------------------------------------------------

#: Other keys of JSON lines, vectors and construct containers.
_IN_RECORDS = frozenset(
    """message fields raw kinds request payload wire source decode_only what kind part error at from to
    sent_on repeat delay late stray unanswered asked offset time file refused work""".split()  # noqa: SIM905
)


def record_key(address: str) -> str:
    """The key of an address."""
    return f"{address}_" if address in _IN_RECORDS else address


# Conversion -------------------------------------------------------------------------------------------------


def pascal(name: str) -> str:
    """``motion.request`` as a class name: ``MotionRequest``."""
    return "".join(word[:1].upper() + word[1:] for word in name.replace(".", "_").split("_"))


def snake(name: str) -> str:
    """``motion.request`` as a C name without its prefix: ``motion_request``."""
    return name.replace(".", "_")


def upper(name: str) -> str:
    """``motion.request`` as a constant: ``MOTION_REQUEST``."""
    return snake(name).upper()
