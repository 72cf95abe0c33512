package android.ranging

class RangingMeasurement(val measurement: Double, val confidence: Int) {
    companion object {
        const val CONFIDENCE_LOW = 0
        const val CONFIDENCE_HIGH = 2
    }
}

class RangingData(val distance: RangingMeasurement?, val timestampMillis: Long)
