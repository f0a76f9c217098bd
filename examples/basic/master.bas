' Lets an operator choose a length, and a second node feed it.
' Ring: this program, feeder.bas, a keypad.
' Keys: key 10 for a longer piece, key 11 for a shorter one, key 20 to feed.

SEND(11,2,10)
PRINT #11,CHR(12);CHR(14);CHR(20);
length=2.5

choose:
  PRINT #11,CURSOR(0);"LENGTH",length[3.2];
  GET #3,k
  IF k=10 THEN length=length+0.25
  IF (k=11)&(length>0.25) THEN length=length-0.25
  IF k<>20 THEN GOTO choose

SEND(10,1,0,length)
PRINT #10,"F";
WAIT UNTIL VR(200)=TRUE OR NETSTAT<>0
IF NETSTAT THEN PRINT #11,CURSOR(20);"NETWORK ERROR",NETSTAT[0],COMMSERROR[0];: NETSTAT=0: COMMSERROR=0
VR(200)=FALSE
lamp=lamp XOR 1
PRINT #11,CURSOR(40);"FED",VR(201)[3.2],"LAMP",lamp[0];
GOTO choose
