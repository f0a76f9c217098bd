meta:
  id: processed
  endian: le
seq:
  - id: key
    type: u1
  - id: data
    type: inner
  - id: hidden
    size: 4
    process: xor(key)
types:
  inner:
    seq:
      - id: x
        type: u1
  other:
    seq:
      - id: y
        type: u1
