meta:
  id: sensor_packet
  title: Weather sensor
  endian: le
  license: CC0-1.0
doc: One packet of a weather sensor.
seq:
  - id: magic
    contents: [0xaa, 0x55]
  - id: version
    type: u1
    valid: 2
  - id: temperature
    type: s2
    doc: In hundredths of a degree
  - id: pressure
    type: u4
    valid:
      min: 30000
      max: 110000
  - id: wind
    type: f4
  - id: reserved
    type: u2
