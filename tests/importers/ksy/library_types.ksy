meta:
  id: library_types
  endian: le
types:
  header:
    seq:
      - id: tow
        type: u4
      - id: week
        type: u2
  place:
    seq:
      - id: latitude
        type: f8
      - id: longitude
        type: f8
  unused:
    seq:
      - id: number
        type: u4
        enum: level
enums:
  level:
    0: error
    1: warning
    300: too_large
