meta:
  id: bit_flags_le
  endian: le
  bit-endian: le
seq:
  - id: low
    type: b4
  - id: high
    type: b4
  - id: wide
    type: b10
  - id: rest
    type: b6
