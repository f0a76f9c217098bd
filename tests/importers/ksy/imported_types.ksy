meta:
  id: imported_types
  endian: le
  imports:
    - /common/vlq
    - other
seq:
  - id: a
    type: u1
  - id: b
    type: vlq
types:
  fine:
    seq:
      - id: x
        type: u1
