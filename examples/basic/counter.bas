' Counts the parts of a batch. Two keypads, one at each end of the machine, set how many parts are wanted.
' Ring: this program, the first keypad, the second one.
' Keys: 0 to 9, key 10 for one more, key 11 for one less, key 13 to start.

first=10: second=11
SEND(first,2,11)                 ' their keys come to this node, those of the first through the second
SEND(second,2,10)
DEFKEY(10,100,-100)
node=first: GOSUB draw
node=second: GOSUB draw

REPEAT
  GOSUB show
  WAIT UNTIL KEY #3
  GET #3,k
  IF k>=0 AND k<=9 THEN wanted=wanted*10+k
  IF k=100 OR k=-100 THEN wanted=wanted+k/100
  IF NOT(wanted>=0 AND wanted<=999) THEN wanted=0
UNTIL k=13

IF wanted>0 THEN GOSUB make ELSE GOSUB none
STOP

make:
  REPEAT
    WA(50)                       ' here a part is made
    VR(1)=VR(1)+1
    GOSUB show
  UNTIL VR(1)=wanted
  RETURN

none:
  PRINT #first,CURSOR(40);"NOTHING TO DO";: PRINT #second,CURSOR(40);"NOTHING TO DO";
  RETURN

draw:
  PRINT #node,CHR(12);CHR(14);CHR(20);"WANTED:"
  PRINT #node,"MADE:";
  RETURN

show:
  PRINT #first,CURSOR(8);wanted[4,0];CURSOR(28);VR(1)[4,0];
  PRINT #second,CURSOR(8);wanted[4,0];CURSOR(28);VR(1)[4,0];
  RETURN
