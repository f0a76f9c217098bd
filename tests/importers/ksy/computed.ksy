meta:
  id: computed
  endian: le
seq:
  - id: raw
    type: u2
params:
  - id: scale
    type: u4
instances:
  celsius:
    value: raw / 10.0
  index:
    pos: 0x10
    type: u4
