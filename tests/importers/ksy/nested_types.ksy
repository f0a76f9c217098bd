meta:
  id: nested_types
  endian: le
seq:
  - id: header
    type: header
  - id: body
    type: body
types:
  header:
    meta:
      endian: be
    seq:
      - id: stamp
        type: stamp
      - id: source
        type: u2
        enum: source
    types:
      stamp:
        seq:
          - id: seconds
            type: u4
          - id: micros
            type: u4
    enums:
      source:
        1: gps
        2: clock
  body:
    seq:
      - id: stamp
        type: header::stamp
      - id: source
        type: u1
        enum: header::source
