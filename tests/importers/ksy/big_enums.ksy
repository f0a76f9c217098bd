meta:
  id: big_enums
  endian: be
seq:
  - id: small
    type: u1
    enum: state
  - id: wide
    type: u2
    enum: state
  - id: signed
    type: s1
    enum: state
  - id: missing
    type: u1
    enum: nowhere
enums:
  state:
    0: idle
    1:
      id: running
      doc: "Moves: really"
    300: beyond
    x: what
