"""What the classes of generated bus modules are derived from: masters and slaves of any protocol on a port.

`qlinkgen.bus.blocking` and `qlinkgen.bus.aio` have masters, `qlinkgen.bus.slaves` has slaves.
"""
