meta:
  id: strings
  encoding: ASCII
  endian: be
seq:
  - id: name
    type: str
    size: 16
    pad-right: 0
  - id: fixed
    type: str
    size: 4
  - id: ended
    type: strz
  - id: line
    type: str
    terminator: 0x0a
  - id: len_comment
    type: u1
  - id: comment
    type: str
    size: len_comment
  - id: wide
    type: str
    size: 8
    encoding: UTF-8
  - id: rest
    size-eos: true
