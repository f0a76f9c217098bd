meta:
  id: calculated_endian
  endian:
    switch-on: order
    cases:
      1: le
      2: be
seq:
  - id: order
    type: u1
  - id: value
    type: u2
