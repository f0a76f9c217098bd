meta:
  id: message_library
  endian: le
  imports:
    - library_types
    - ../elsewhere
types:
  msg_position:
    doc: |
      Where the receiver is.
    seq:
      - id: header
        type: library_types::header
      - id: place
        type: library_types::place
      - id: flags
        type: u1
      - id: age
        type: u2
        if: is_corrected
      - id: fix
        type: u1
        if: (flags >> 4) & 3 != 0
    instances:
      is_corrected:
        value: flags & 0x80 != 0
  msg_log:
    seq:
      - id: level
        type: u1
        enum: library_types::level
      - id: text
        type: str
        size: 8
        encoding: ascii
      - id: more
        type: u1
        if: not _io.eof
  msg_settings:
    seq:
      - id: setting
        type: setting
        repeat: eos
  setting:
    seq:
      - id: kind
        type: u1
      - id: value
        type:
          switch-on: kind
          cases:
            1: u1
            2: library_types::place
            _: u4
      - id: name
        type: str
        size: 4
        encoding: ASCII
  msg_note:
    seq:
      - id: kind
        type: u1
      - id: detail
        type:
          switch-on: kind
          cases:
            1: text
            2: several
  text:
    seq:
      - id: text
        type: str
        size-eos: true
        encoding: ASCII
  several:
    seq:
      - id: first
        type: b3le
      - id: second
        type: b5le
