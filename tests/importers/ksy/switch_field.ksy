meta:
  id: switch_field
  endian: be
seq:
  - id: readings
    type: reading
    repeat: expr
    repeat-expr: 3
types:
  reading:
    seq:
      - id: format
        type: u1
        valid:
          any-of: [1, 2, 4]
      - id: value
        type:
          switch-on: format
          cases:
            1: u1
            2: u2
            4: wide
      - id: quality
        type: u1
  wide:
    seq:
      - id: high
        type: u2
      - id: low
        type: u2
