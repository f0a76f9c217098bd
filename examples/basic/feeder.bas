' Feeds the length in VR(0) for each F, and tells the master the sum.
' Ring: master.bas, this program, a keypad.

waiting:
  IF NOT(KEY #4) THEN GOTO waiting
  GET #4,character
  IF character<>70 THEN GOTO waiting
  WA(200)                        ' here the material moves
  fed=fed+VR(0)
  SEND(11,1,201,fed)             ' the master is two nodes on, past the keypad
  SEND(11,1,200,TRUE)
  GOTO waiting
