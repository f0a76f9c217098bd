meta:
  id: class
  endian: le
seq:
  - id: int
    type: u1
  - id: none
    type: u1
    enum: true
  - id: a_name_that_is_much_longer_than_forty_characters_altogether
    type: u2
  - id: a_name_that_is_much_longer_than_forty_characters_in_all
    type: u2
  - id: u8
    type: u8
enums:
  true:
    0: 'yes'
    1: class
    2: 'off'
