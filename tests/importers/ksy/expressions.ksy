meta:
  id: expressions
  endian: le
seq:
  - id: packets
    type: packet
    repeat: eos
types:
  packet:
    seq:
      - id: type
        type: u1
      - id: len
        type: u1
      - id: body
        size: len
        type:
          switch-on: type
          cases:
            1: masked
            2: divided
            3: parents
            4: fine
            5: scaled
  masked:
    seq:
      - id: flags
        type: u1
      - id: extra
        type: u2
        if: flags & 0x80 != 0
  divided:
    seq:
      - id: bits
        type: u1
      - id: data
        size: (bits + 7) / 8
  parents:
    seq:
      - id: data
        size: _parent.len - 1
  scaled:
    seq:
      - id: num_pairs
        type: u2
      - id: pairs
        type: s4
        repeat: expr
        repeat-expr: num_pairs * 2
  fine:
    seq:
      - id: data
        size-eos: true
