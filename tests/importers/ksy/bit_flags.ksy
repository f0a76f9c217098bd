meta:
  id: bit_flags
  endian: be
seq:
  - id: version
    type: b3
  - id: more
    type: b1
    doc: Another one follows
  - id: kind
    type: b4
    enum: kind
  - id: length
    type: b12
  - id: reserved
    type: b4
  - id: whole
    type: b16
  - id: last
    type: b5
  - id: after
    type: u1
enums:
  kind:
    0: data
    1: control
    15: other
