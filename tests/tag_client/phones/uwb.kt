package androidx.core.uwb

class RangingMeasurement(val value: Float)

class RangingPosition(val distance: RangingMeasurement?, val azimuth: RangingMeasurement?, val elapsedRealtimeNanos: Long)

sealed class RangingResult {
    class RangingResultPosition(val position: RangingPosition) : RangingResult()

    class RangingResultPeerDisconnected : RangingResult()
}
