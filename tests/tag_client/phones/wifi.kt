// The classes of Android that the example takes its results from, as their documentation declares them, without a phone behind.
package android.net.wifi.rtt

class RangingResult(val status: Int, val distanceMm: Int, val rangingTimestampMillis: Long) {
    companion object {
        const val STATUS_SUCCESS = 0
        const val STATUS_FAIL = 1
    }
}
