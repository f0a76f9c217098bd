meta:
  id: until
  endian: be
seq:
  - id: items
    type: item
    repeat: until
    repeat-until: _.more == 0
types:
  item:
    seq:
      - id: more
        type: b1
      - id: value
        type: b7
