meta:
  id: conditions
  endian: le
seq:
  - id: kind
    type: u1
    enum: kind
  - id: level
    type: u1
  - id: has_extra
    type: b1
  - id: unused
    type: b7
  - id: a
    type: u2
    if: kind == kind::big
  - id: b
    type: u2
    if: level > 3 and kind != kind::small
  - id: c
    type: u4
    if: has_extra
  - id: d
    type: u1
    if: (level <= 7)
enums:
  kind:
    0: small
    1: big
