/**
 * Sends the ranges that an Android phone measures with its own radio. For an app, which starts the sessions and has the
 * permissions; service/docs/how-to/range-with-a-phone.md says what the fields mean.
 */
package dropanchor

import android.net.wifi.rtt.RangingResult as WifiResult
import android.os.SystemClock
import android.ranging.RangingData
import android.ranging.RangingMeasurement
import androidx.core.uwb.RangingResult as UwbResult
import java.net.HttpURLConnection
import java.net.URL
import java.util.Random

/** Makes a message of each range to one peer. [isAnchor]: this phone is the anchor, at a fixed place, and the peer the tag. */
class Ranges(private val anchor: String, private val isAnchor: Boolean, private val send: (String) -> Unit) {
    private val bootId = 1 + Random().nextInt(Int.MAX_VALUE - 1)
    private var sequence = 0L

    /** UWB: `session.prepareSession(parameters).collect { ranges.uwb(it) }`. */
    fun uwb(result: UwbResult) {
        val position = (result as? UwbResult.RangingResultPosition)?.position ?: return
        val distance = position.distance ?: return
        message(position.elapsedRealtimeNanos, distance.value.toDouble(), position.azimuth?.value?.toDouble())
    }

    /** Wi-Fi RTT: from `RangingResultCallback.onRangingResults`, the result of this peer. */
    fun wifi(result: WifiResult) {
        if (result.status == WifiResult.STATUS_SUCCESS) {
            message(result.rangingTimestampMillis * 1_000_000, result.distanceMm / 1000.0)
        }
    }

    /** Bluetooth channel sounding: from `RangingSession.Callback.onResults`. */
    fun bluetooth(data: RangingData) {
        val distance = data.distance ?: return
        if (distance.confidence != RangingMeasurement.CONFIDENCE_LOW) {
            message(data.timestampMillis * 1_000_000, distance.measurement)
        }
    }

    @Synchronized
    private fun message(sinceBootNs: Long, rangeM: Double, rightDeg: Double? = null) {
        val tNs = System.currentTimeMillis() * 1_000_000 - (SystemClock.elapsedRealtimeNanos() - sinceBootNs)
        val whose = "\"t_ns\": $tNs, \"anchor\": \"$anchor\""
        val bearing = // Android counts to the right, bearings count to the left
            if (!isAnchor || rightDeg == null) "" else "{$whose, \"bearing_rad\": ${-Math.toRadians(rightDeg)}, \"std_rad\": 0.17}"
        val range = "{$whose, \"range_m\": $rangeM}"
        send("{\"boot_id\": $bootId, \"sequence\": ${sequence++}, \"range\": [$range], \"bearing\": [$bearing]}")
    }
}

/** Posts a message with the key of the tag, and returns the status: 202. Call it off the main thread; repeat it after a failure. */
fun post(url: String, key: String, message: String): Int {
    val connection = URL("$url/api/v1/ingest/samples").openConnection() as HttpURLConnection
    connection.doOutput = true
    connection.setRequestProperty("Authorization", "Bearer $key")
    connection.setRequestProperty("Content-Type", "application/json")
    connection.outputStream.use { it.write(message.toByteArray()) }
    return connection.responseCode
}
