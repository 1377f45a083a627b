#include "server/net/lws_callbacks.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "server/net/lws_http.h"
#include "server/net/lws_site.h"
#include "server/net/wire.h"

namespace catgs {
namespace {

/// Per-connection memory, owned and zeroed by libwebsockets.
struct HttpSlot {
  LwsHttpExchange* exchange;
};
struct WebsocketSlot {
  std::shared_ptr<LwsWebsocket>* connection;
};

Service& service_of(lws* wsi) {
  return *static_cast<Service*>(lws_context_user(lws_get_context(wsi)));
}

LwsHttpExchange* new_exchange(lws* wsi) {
  return new LwsHttpExchange(service_of(wsi).answered, service_of(wsi).disk);
}

void forget(lws* wsi, HttpSlot& slot) {
  service_of(wsi).answered.remove(wsi);
  delete std::exchange(slot.exchange, nullptr);
}

bool is_get_or_head(lws* wsi) {
  return lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) > 0 ||
         lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
}

bool is_served_delete(lws* wsi) {
  return lws_hdr_total_length(wsi, WSI_TOKEN_DELETE_URI) > 0 &&
         site_of(wsi).serves_delete(request_header(wsi, WSI_TOKEN_DELETE_URI));
}

// Results of callbacks.
constexpr int keep_reading = 0;
constexpr int close_connection = -1;

/// Keeps an upload's body if a slot is free.
int on_upload(lws* wsi, LwsHttpExchange& exchange, std::size_t bytes) {
  Service& service = service_of(wsi);
  const bool large = bytes > max_upload_bytes;
  if (auto refusal = refuse_upload(wsi))
    return large ? exchange.refuse_body(wsi, *std::move(refusal), service.scratch)
                 : exchange.begin_refused_upload(wsi, *std::move(refusal));
  UploadSlots& slots = large ? service.large_uploads : service.uploads;
  if (auto slot = slots.take(token_of(wsi), limited_as(client_address_of(wsi))))
    return exchange.begin_upload(wsi, slot, bytes);
  site_of(wsi).uploads.on_full();
  return exchange.refuse_body(
      wsi, busy_response("503: others are saving at the moment: try again in a second\n"),
      service.scratch);
}

int on_put(lws* wsi, LwsHttpExchange& exchange) {
  const std::uint64_t bytes = body_length(wsi).value_or(0);
  const std::size_t most = site_of(wsi).uploads.most_bytes(request_header(wsi, WSI_TOKEN_PUT_URI));
  if (bytes >= 1 && bytes <= most) return on_upload(wsi, exchange, static_cast<std::size_t>(bytes));
  const int status = bytes < 1 ? 411 : 413;
  const std::string why =
      bytes < 1 ? fmt::format("411: send a body of 1 to {} bytes and its Content-Length", most)
                : fmt::format("413: send at most {} bytes, not {}", most, bytes);
  note_refused(wsi, static_cast<unsigned>(status), "upload refused: " + why);
  if (exchange.refuse_body(wsi, text_response(status, why + "\n"), service_of(wsi).scratch) != 0)
    return close_connection;
  const bool body_follows = request_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH) != "0";
  return body_follows ? keep_reading : close_connection;
}

/// A connection answers one request, and every answer says so. libwebsockets does not show the raw
/// head. A line that a proxy reads as a length may be none to libwebsockets, so later bytes may be
/// a body.
int on_request(lws* wsi, HttpSlot& slot) {
  const Site& site = site_of(wsi);
  service_of(wsi).gate.requested(wsi);
  if (const auto refused = refuse_faulty_head(wsi)) return *refused;
  if (lacks_tls(wsi) && !is_get_or_head(wsi))
    return refuse_request(wsi, 400, "this port speaks https");
  // libwebsockets does not parse chunks and would take them for the next request.
  if (lws_hdr_total_length(wsi, WSI_TOKEN_HTTP_TRANSFER_ENCODING) > 0)
    return refuse_request(wsi, 411, "Content-Length is needed, not Transfer-Encoding");
  if (site.uploads.take && lws_hdr_total_length(wsi, WSI_TOKEN_PUT_URI) > 0) {
    slot.exchange = new_exchange(wsi);
    return on_put(wsi, *slot.exchange);
  }
  if (!is_get_or_head(wsi) && !is_served_delete(wsi))
    return refuse_request(wsi, 405, "only GET and HEAD are served here");
  // The body of a GET has no meaning, and libwebsockets would report it while the answer is being
  // sent.
  if (const auto bytes = body_length(wsi); bytes != 0)
    return refuse_request(wsi, bytes ? 413 : 400,
                          is_get_or_head(wsi) ? "a GET needs no body" : "a DELETE needs no body");
  slot.exchange = new_exchange(wsi);
  const std::string host = request_header(wsi, WSI_TOKEN_HOST);
  const HttpHandler handler = [&](const HttpRequest& request) {
    return lacks_tls(wsi) ? redirect_to_https(host, request) : respond(wsi, host, request);
  };
  return slot.exchange->begin(wsi, handler, site_address(wsi, host));
}

// In a round of the service loop. A handshake takes 0.1 to 1 ms.
constexpr int most_accepted = 8;
constexpr int most_failed = 64;

/// Ends libwebsockets' loop over waiting connections, see accept_again(). A handshake that fails
/// opens the port again. True: too many have, and only a refusal ends the loop.
bool accepts_too_many(Service& service, lws* listener) {
  if (++service.accepted < most_accepted) return false;
  lws_rx_flow_control(listener, 0);
  service.held_ports.push_back(listener);
  return service.accepted > most_failed;
}

/// Called before the connection has a lws. Operators and probes get in even when others do not. A
/// proxy has one address for all its clients.
int on_accept(lws* listener, int descriptor) {
  const Site& site = site_of(listener);
  const bool too_many = accepts_too_many(service_of(listener), listener);
  if (!site.accept) return keep_reading;
  std::array<char, 64> peer{};
  lws_get_peer_simple_fd(descriptor, peer.data(), peer.size());
  const std::string counted = site.proxies.is_proxy(peer.data()) ? "" : limited_as(peer.data());
  auto why = service_of(listener).gate.refusal(descriptor, AcceptGate::descriptor_limit(), counted,
                                               Clock::now());
  if (too_many && !why) why = "connection refused: many handshakes fail at the moment";
  if (!why) return keep_reading;
  site.on_refused({.event = "connection_refused", .address = peer.data()},
                  fmt::format("{}: {}", peer.data(), *why));
  return close_connection;
}

int on_http(lws* wsi, lws_callback_reasons reason, HttpSlot* slot, void* in, std::size_t length) {
  switch (reason) {
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION:
      return on_accept(wsi, static_cast<int>(reinterpret_cast<std::intptr_t>(in)));
    case LWS_CALLBACK_WSI_CREATE:
      service_of(wsi).gate.opened(wsi);
      return 0;
    case LWS_CALLBACK_WSI_DESTROY:
      service_of(wsi).gate.closed(wsi);
      return 0;
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
      service_of(wsi).gate.requested(wsi);
      return confirm_upgrade(wsi);
    case LWS_CALLBACK_RAW_ADOPT:  // what libwebsockets makes of a CONNECT
      note_refused(wsi, 0, "request refused: this is no proxy");
      return close_connection;
    case LWS_CALLBACK_HTTP:
      return on_request(wsi, *slot);
    case LWS_CALLBACK_HTTP_BODY:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->take_body(wsi, {static_cast<const char*>(in), length});
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->end_body(wsi, site_of(wsi).uploads);
    case LWS_CALLBACK_TIMER:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->on_timer(wsi);
    case LWS_CALLBACK_HTTP_WRITEABLE:
      if (!slot || !slot->exchange) return 0;
      return slot->exchange->on_writable(wsi, service_of(wsi).scratch);
    case LWS_CALLBACK_HTTP_DROP_PROTOCOL:
    case LWS_CALLBACK_CLOSED_HTTP:
      if (slot) forget(wsi, *slot);
      return 0;
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:  // a websocket that did not ask for catgs.v1
      return refuse_request(wsi, 400, "ask for subprotocol catgs.v1");
    case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
      for (const auto& connection : service_of(wsi).waker->take()) connection->service_woken();
      return 0;
    default:
      return lws_callback_http_dummy(wsi, reason, slot, in, length);
  }
}

int on_websocket(lws* wsi, lws_callback_reasons reason, WebsocketSlot* slot,
                 std::span<const std::byte> bytes) {
  switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION: {
      const Site& site = site_of(wsi);
      if (const auto refused = refuse_faulty_head(wsi)) return *refused;
      // libwebsockets accepts any protocol version and any method.
      if (lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) <= 0 ||
          request_header(wsi, WSI_TOKEN_VERSION) != "13")
        return refuse_request(wsi, 400, "open websockets by GET, Sec-WebSocket-Version 13");
      const std::string origin = request_header(wsi, WSI_TOKEN_ORIGIN);
      const std::string host = request_header(wsi, WSI_TOKEN_HOST);
      if (site.accept && host_allowed(wsi, host) &&
          origin_allowed(origin, host, site.allowed_origins))
        return 0;
      note_refused_origin(wsi, "websocket", origin, host);
      lws_return_http_status(wsi, 403, "this origin is not allowed");
      return -1;
    }
    case LWS_CALLBACK_ESTABLISHED: {
      auto connection =
          std::make_shared<LwsWebsocket>(wsi, service_of(wsi).waker, client_address_of(wsi));
      slot->connection = new std::shared_ptr<LwsWebsocket>(connection);
      connection->service_listen(site_of(wsi).accept(connection));
      return 0;
    }
    case LWS_CALLBACK_RECEIVE:
      return (*slot->connection)->service_receive(bytes);
    case LWS_CALLBACK_TIMER:
      return (*slot->connection)->service_timer();
    case LWS_CALLBACK_SERVER_WRITEABLE:
      return (*slot->connection)->service_writeable(service_of(wsi).scratch);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
      (*slot->connection)->service_peer_closes(bytes);
      return 0;
    case LWS_CALLBACK_CLOSED:
      if (slot && slot->connection) {
        (*slot->connection)->service_closed();
        delete std::exchange(slot->connection, nullptr);
      }
      return 0;
    default:
      return 0;
  }
}

int http_callback(lws* wsi, lws_callback_reasons reason, void* user, void* in, std::size_t length) {
  ++service_of(wsi).callbacks;
  return guarded([&] { return on_http(wsi, reason, static_cast<HttpSlot*>(user), in, length); });
}

int websocket_callback(lws* wsi, lws_callback_reasons reason, void* user, void* in,
                       std::size_t length) {
  ++service_of(wsi).callbacks;
  return guarded([&] {
    return on_websocket(wsi, reason, static_cast<WebsocketSlot*>(user),
                        {static_cast<const std::byte*>(in), length});
  });
}

}  // namespace

// The buffer holds one whole message. Larger messages arrive in pieces and are refused.
const lws_protocols service_protocols[] = {
    {"http", http_callback, sizeof(HttpSlot), 0, 0, nullptr, 0},
    {"catgs.v1", websocket_callback, sizeof(WebsocketSlot), wire::max_client_message_bytes, 0,
     nullptr, 0},
    {nullptr, nullptr, 0, 0, 0, nullptr, 0},
};

void accept_again(Service& service) {
  for (lws* listener : service.held_ports) lws_rx_flow_control(listener, 1);
  service.held_ports.clear();
  service.accepted = 0;
}

void pause_where_nothing_happens(Service& service) {
  constexpr std::chrono::milliseconds pause{2};
  const bool asked = std::exchange(service.callbacks, 0) > 0;
  if (!asked && !service.idle_rounds.take(Clock::now())) std::this_thread::sleep_for(pause);
}

}  // namespace catgs
