import android.net.wifi.rtt.RangingResult as WifiResult
import android.ranging.RangingData
import android.ranging.RangingMeasurement as Measured
import androidx.core.uwb.RangingMeasurement
import androidx.core.uwb.RangingPosition
import androidx.core.uwb.RangingResult
import dropanchor.Ranges
import dropanchor.post

/** Feeds a result of each kind, and posts what comes of it. Arguments: the address of the service and a key. */
fun main(arguments: Array<String>) {
    val send = { message: String -> println(post(arguments[0], arguments[1], message)) }
    val isAnchor = Ranges("yard", true, send)
    val isTag = Ranges("yard", false, send)
    val right = RangingPosition(RangingMeasurement(3.5f), RangingMeasurement(30f), 59_000_000_000L)
    for (ranges in listOf(isAnchor, isTag)) ranges.uwb(RangingResult.RangingResultPosition(right))
    isTag.uwb(RangingResult.RangingResultPosition(RangingPosition(null, null, 0)))
    isTag.uwb(RangingResult.RangingResultPeerDisconnected())
    isTag.wifi(WifiResult(WifiResult.STATUS_SUCCESS, 4500, 58_000))
    isTag.wifi(WifiResult(WifiResult.STATUS_FAIL, 9000, 58_000))
    isTag.bluetooth(RangingData(Measured(5.5, Measured.CONFIDENCE_HIGH), 57_000))
    isTag.bluetooth(RangingData(Measured(9.0, Measured.CONFIDENCE_LOW), 57_000))
    isTag.bluetooth(RangingData(null, 57_000))
}
