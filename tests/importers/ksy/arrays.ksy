meta:
  id: arrays
  endian: le
seq:
  - id: fixed
    type: u2
    repeat: expr
    repeat-expr: 4
  - id: num_points
    type: u1
  - id: points
    type: point
    repeat: expr
    repeat-expr: num_points
  - id: values
    type: f8
    repeat: eos
types:
  point:
    seq:
      - id: x
        type: s2
      - id: y
        type: s2
