/// Sends the ranges that an iPhone measures with its own UWB radio. For an app, which exchanges the discovery tokens and
/// runs the session; service/docs/how-to/range-with-a-phone.md says what the fields mean.
import Foundation
import NearbyInteraction

struct Range: Encodable {
    let t_ns: Int64
    let anchor: String
    let range_m: Double
}

struct Bearing: Encodable {
    let t_ns: Int64
    let anchor: String
    let bearing_rad: Double
    let std_rad: Double
}

struct Message: Encodable {
    let boot_id: UInt32
    let sequence: UInt32
    let range: [Range]
    let bearing: [Bearing]
}

/// Makes a message of each range to one peer. isAnchor: this phone is the anchor, at a fixed place, and the peer the tag.
final class Ranges: NSObject, NISessionDelegate {
    private let anchor: String
    private let isAnchor: Bool
    private let send: (Data) -> Void
    private let bootId = UInt32.random(in: 1...UInt32.max)
    private var sequence: UInt32 = 0

    init(anchor: String, isAnchor: Bool, send: @escaping (Data) -> Void) {
        self.anchor = anchor
        self.isAnchor = isAnchor
        self.send = send
    }

    func session(_ session: NISession, didUpdate nearbyObjects: [NINearbyObject]) {
        let tNs = Int64(Date().timeIntervalSince1970 * 1_000) * 1_000_000  // the session tells no time
        for object in nearbyObjects {
            guard let distance = object.distance else { continue }
            let range = Range(t_ns: tNs, anchor: anchor, range_m: Double(distance))
            let bearing = bearings(of: object, tNs: tNs)
            let message = Message(boot_id: bootId, sequence: sequence, range: [range], bearing: bearing)
            sequence += 1
            if let body = try? JSONEncoder().encode(message) { send(body) }
        }
    }

    /// x points right and z to who looks at the screen, so the peer is ahead at z = -1; bearings count to the left.
    private func bearings(of object: NINearbyObject, tNs: Int64) -> [Bearing] {
        guard isAnchor, let direction = object.direction else { return [] }
        let left = atan2(Double(-direction.x), Double(-direction.z))
        return [Bearing(t_ns: tNs, anchor: anchor, bearing_rad: left, std_rad: 0.17)]
    }
}

/// Posts a message with the key of the tag; the status is 202. Repeat it after a failure.
func post(_ body: Data, to url: URL, key: String) async throws -> Int {
    var request = URLRequest(url: url.appendingPathComponent("api/v1/ingest/samples"))
    request.httpMethod = "POST"
    request.setValue("Bearer \(key)", forHTTPHeaderField: "Authorization")
    request.setValue("application/json", forHTTPHeaderField: "Content-Type")
    let (_, response) = try await URLSession.shared.upload(for: request, from: body)
    return (response as? HTTPURLResponse)?.statusCode ?? 0
}
