#include "tests/support/simulated_link.h"

#include <algorithm>

namespace catgs::test {

using std::chrono::microseconds;

namespace {

/// `time`, or the end of the outage that it falls into.
microseconds after(const std::vector<Outage>& outages, microseconds time) {
  for (const Outage& outage : outages)
    if (time >= outage.from && time < outage.to) return outage.to;
  return time;
}

}  // namespace

double SimulatedLink::bits_between(microseconds from, microseconds to) const {
  double bits = 0.0;
  for (std::size_t i = 0; i < plan_.rates.size(); ++i) {
    const microseconds begin = std::max(from, plan_.rates[i].at);
    const microseconds end = i + 1 < plan_.rates.size() ? std::min(to, plan_.rates[i + 1].at) : to;
    if (end > begin)
      bits += plan_.rates[i].bits_per_s * 1e-6 * static_cast<double>((end - begin).count());
  }
  return bits;
}

microseconds SimulatedLink::when_sent(double bits, microseconds start) const {
  for (std::size_t i = 0; i < plan_.rates.size(); ++i) {
    const bool last = i + 1 == plan_.rates.size();
    if (!last && plan_.rates[i + 1].at <= start) continue;
    const double rate = plan_.rates[i].bits_per_s;
    const double here = last ? bits : bits_between(start, plan_.rates[i + 1].at);
    if (here >= bits && rate > 0.0)
      return start + microseconds(static_cast<std::int64_t>(1e6 * bits / rate));
    bits -= here;
    start = plan_.rates[i + 1].at;
  }
  return start;
}

microseconds SimulatedLink::send(std::size_t bytes, microseconds now) {
  free_at_ = when_sent(8.0 * static_cast<double>(bytes), std::max(now, free_at_));
  const auto jitter = plan_.jitter.count() > 0
                          ? static_cast<std::int64_t>(random_()) % (plan_.jitter.count() + 1)
                          : 0;
  const microseconds arrival = free_at_ + plan_.delay + microseconds(jitter);
  last_arrival_ = std::max(last_arrival_, after(plan_.stalls, arrival));
  return last_arrival_;
}

std::size_t SimulatedLink::unsent_bytes(microseconds now) const {
  if (free_at_ <= now) return 0;
  const double backlog = bits_between(now, free_at_) / 8.0;
  return static_cast<std::size_t>(std::max(0.0, backlog - static_cast<double>(plan_.queue_bytes)));
}

bool SimulatedClient::asleep(microseconds now) const { return after(plan_.sleeps, now) != now; }

void SimulatedClient::receive(const FrameTicket& ticket, microseconds arrival) {
  const microseconds received = after(plan_.sleeps, arrival);
  const double megapixels = 1e-6 * ticket.size_px.x * ticket.size_px.y;
  const microseconds duration(
      static_cast<std::int64_t>(1e6 * plan_.decode_s_per_megapixel * megapixels));
  decoder_free_at_ = after(plan_.sleeps, std::max(received, decoder_free_at_) + duration);
  frames_.push_back({ticket, received, decoder_free_at_});
}

Ack SimulatedClient::ack_of(const Decoded& frame, std::optional<microseconds> shown) {
  Ack ack;
  ack.frame_id = frame.ticket.frame_id;
  ack.received_us = clock_us(frame.received);
  ack.decoded_us = clock_us(frame.decoded);
  ack.dropped = !shown;
  if (!shown) return ack;
  ack.presented_us = clock_us(*shown);
  ack.pose_age_us = static_cast<std::uint32_t>(ack.presented_us - frame.ticket.pose_client_time_us);
  return ack;
}

std::vector<Ack> SimulatedClient::acknowledge(microseconds now) {
  std::vector<Ack> acks;
  for (; next_refresh_ <= now; next_refresh_ += plan_.refresh) {
    if (asleep(next_refresh_)) continue;
    const auto is_decoded = [&](const Decoded& frame) { return frame.decoded <= next_refresh_; };
    const auto end = std::ranges::find_if_not(frames_, is_decoded);
    for (auto frame = frames_.begin(); frame != end; ++frame) {
      const bool newest = frame + 1 == end;
      acks.push_back(ack_of(*frame, newest ? std::optional(next_refresh_) : std::nullopt));
    }
    frames_.erase(frames_.begin(), end);
  }
  return acks;
}

}  // namespace catgs::test
