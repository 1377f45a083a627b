#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/encode/decoder.h"
#include "tests/load/session.h"
#include "tests/load/wire_client.h"

namespace catgs::load {

/// Where a session decodes what it received, one frame after the other: really (`decode`; with
/// `only_pictures` from an IDR at the time of a picture until that is kept), or only for as long as
/// it would take (`decode_time_s`). Bounded: what does not fit is dropped, and decoding
/// resumes at the next IDR.
class DecodeStage {
 public:
  /// A decoder's calls to its session.
  struct Callbacks {
    std::function<void(const v1::Ack& ack, std::int64_t presented_us)> acknowledge;
    std::function<void()> request_idr;
  };
  DecodeStage(const SessionSettings& settings, boost::asio::thread_pool& decoders,
              SessionReport& report, Callbacks callbacks,
              const boost::asio::any_io_executor& executor);

  /// The next frame is to be taken. False: nobody needs it decoded.
  [[nodiscard]] bool has_work() const;
  void take(const FrameMessage& frame, const v1::Ack& ack);
  /// Sets the scene of the following frames, for the pictures that are kept.
  void set_scene(const v1::SceneFacts& scene) { scene_ = scene; }
  /// Decodes until it is cancelled. Throws InputError where a decoder is missing.
  boost::asio::awaitable<void> run();

 private:
  struct Item {
    v1::FrameHeader header;
    std::vector<std::byte> bitstream;
    v1::Ack ack;
  };
  struct Decoded {
    EncodeStatus status;
    DecodedPicture picture;
    std::int64_t duration_us = 0;
  };
  /// Forgets the decoder and what it has not decoded yet, when its time has come.
  void lose_decoder();
  boost::asio::awaitable<void> decode(Item& item);
  boost::asio::awaitable<Decoded> decode_on_pool(const Item& item);
  /// In the middles of equal parts of the session's time.
  [[nodiscard]] bool picture_is_due() const;
  void keep_picture(const Item& item, Decoded& decoded);
  /// For the display, and the check of it.
  void keep_frame(Item& item);
  /// The first ones of the first rests, until one is large and late enough to be sharp.
  void keep_still(const Item& item, const Decoded& decoded);

  const SessionSettings& settings_;
  boost::asio::thread_pool& decoders_;
  SessionReport& report_;
  Callbacks callbacks_;
  boost::asio::steady_timer filled_;  // cancelled when there is something to decode
  std::deque<Item> queue_;
  std::unique_ptr<Decoder> decoder_;
  bool decoder_is_new_ = true;  // no frame of it was kept
  std::optional<v1::Codec> codec_;
  v1::SceneFacts scene_;
  bool wait_for_idr_ = true;
  std::int64_t decoder_lost_us_;  // last, or when it was made
};

}  // namespace catgs::load
