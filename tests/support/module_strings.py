"""What UWB modules print, as their makers and users document it."""

LEC = (
    "DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,0.00,8.05,0.00,5.68,AN2,DCAE,8.31,0.00,0.00,6.91,"
    "AN3,15BA,0.00,0.00,0.00,8.72,POS,6.95,5.37,-1.97,52"
)
LEC_RANGES = [("022E", 3.44), ("9280", 5.68), ("DCAE", 6.91), ("15BA", 8.72)]
LEC_ONE = "DIST,1,AN0,D00C,0.00,0.00,0.00,0.79"
LEC_DAMAGED = (
    "DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,0.00,8.05,0.00,5.68,AN2,DCAE,8.31,0.00,0.00,6.91,"
    "AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,8.72,POS,6.95,5.37,-1.97,52"
)
LES = (
    "022E[7.94,8.03,0.00]=3.38 9280[0.00,8.05,0.00]=5.49 DCAE[8.31,0.00,0.00]=6.76 15BA[0.00,0.00,0.00]=8.66 "
    "le_us=3082 est[6.97,5.17,-1.77,53]"
)
LES_RANGES = [("022E", 3.38), ("9280", 5.49), ("DCAE", 6.76), ("15BA", 8.66)]
LES_ONE = "022E[0.00,0.00,0.00]=3.38"
LEP = "POS,7.10,5.24,-2.03,53"

NOTIFICATION = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=39, block_index=39, n_measurements=1 "
    '[mac_address=0x0001, status="SUCCESS", distance[cm]=71]}'
)
NOTIFICATION_TWO_LINES = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=0, block_index=0, n_measurements=1\n\r "
    '[mac_address=0x0001, status="SUCCESS", distance[cm]=210, RSSI[dBm]=-78.0]}'
)
NOTIFICATION_FOUR = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=148, block_index=148, n_measurements=4\n"
    ' [mac_address=0x0001, status="SUCCESS", distance[cm]=245];\n'
    ' [mac_address=0x0002, status="SUCCESS", distance[cm]=312];\n'
    ' [mac_address=0x0003, status="RX_TIMEOUT"];\n'
    ' [mac_address=0x0004, status="SUCCESS", distance[cm]=403]}'
)
NOTIFICATION_NO_ANSWER = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=85, block_index=85, n_measurements=1\n"
    ' [mac_address=0x0001, status="RX_TIMEOUT"]}'
)
NOTIFICATION_NEGATIVE = (
    "SESSION_INFO_NTF: {session_handle=1, sequence_number=12, block_index=0, n_measurements=1\n"
    ' [mac_address=0x0000, status="SUCCESS", distance[cm]=-75]}'
)

TREK_MC = "mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0"
TREK_MC_RANGES = [(0, 1.635), (1, 1.443), (2, 1.298), (3, 1.227)]
TREK_MR = "mr 0f 000005a4 000004c8 00000436 000003f9 0958 c0 40424042 a0:0"
TREK_MA = "ma 07 00000000 0000085c 00000659 000006b7 095b 26 00024bed a0:0"
TREK_CLONE = "mc 00 ffffffff ffffffff 00002134 000005dc ffffffff ffffffff ffffffff ffffffff 095f c1 00024c24 a01:0 1a9a"

MAKERFABS = "AT+RANGE=tid:1,mask:04,seq:63,range:(0,0,30,0,0,0,0,0),rssi:(0.00,0.00,-77.93,0.00,0.00,0.00,0.00,0.00)"
MAKERFABS_NAMED = "AT+RANGE=tid:7,mask:0F,seq:128,range:(997,1321,911,738,0,0,0,0),ancid:(0,1,2,3,-1,-1,-1,-1)"

NODEFRAME2 = bytes.fromhex(
    "5504ac000201ba661d000609ffde0a00dfffffe80300faffff1a00000000 00c0120000000000000027ace23c56ed1c3cd2703bbd3257663e"
    "3bcb1b41937061bd25b26b41a1226c41dada6b416d23e92370dddbf7303f5fd6313fba811e3e4769e2bd919b4040c523000040405cd51c00"
    "00001d006d130401006b0c00b19fa6661d0016450101ac1500b4a1a6661d00d3010102481a00ca9fa6661d0038ba01032b1200c6a0a6661d"
    "00644025"
)
NODEFRAME2_RANGES = [(0, 3.179), (1, 5.548), (2, 6.728), (3, 4.651)]
NODEFRAME3 = bytes.fromhex(
    "550532000201f81107006fd06e000000 01025a13040100220b00b59f0101a31700b6a00102881c00aa9f0103e61400b8a09a"
)
NODEFRAME3_RANGES = [(0, 2.85), (1, 6.051), (2, 7.304), (3, 5.35)]
