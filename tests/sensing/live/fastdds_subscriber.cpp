// Prints the first message of each topic as hexadecimal CDR, received by Fast DDS: DOMAIN, then pairs TOPIC TYPE.
// Types are taken as bytes, so that no generated code is needed.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <memory>
#include <thread>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<unsigned char>;

class AnyType : public TopicDataType {
   public:
    explicit AnyType(const char* name) {
        setName(name);
        m_typeSize = 1 << 20;
        m_isGetKeyDefined = false;
    }
    bool serialize(void*, SerializedPayload_t*) override { return false; }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return 0u; };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

int main(int count, char** words) {
    DomainParticipantQos own = PARTICIPANT_QOS_DEFAULT;
    auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList = {"127.0.0.1"};  // as ROS has it with ROS_LOCALHOST_ONLY=1
    own.transport().use_builtin_transports = false;
    own.transport().user_transports = {loopback};
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(std::atoi(words[1]), own);
    if (participant == nullptr) return 3;
    auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    DataReaderQos quality = DATAREADER_QOS_DEFAULT;
    quality.reliability().kind = RELIABLE_RELIABILITY_QOS;
    quality.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    std::vector<DataReader*> readers;
    for (int word = 2; word + 1 < count; word += 2) {
        TypeSupport type(new AnyType(words[word + 1]));
        type.register_type(participant);
        auto* topic = participant->create_topic(words[word], words[word + 1], TOPIC_QOS_DEFAULT);
        readers.push_back(subscriber->create_datareader(topic, quality));
    }
    size_t seen = 0;
    while (seen < readers.size()) {
        for (auto*& reader : readers) {
            Bytes bytes;
            SampleInfo info;
            if (reader == nullptr || reader->take_next_sample(&bytes, &info) != ReturnCode_t::RETCODE_OK) continue;
            if (!info.valid_data) continue;
            std::printf("%s ", reader->get_topicdescription()->get_name().c_str());
            for (unsigned char byte : bytes) std::printf("%02x", byte);
            std::puts("");
            std::fflush(stdout);
            reader = nullptr;
            ++seen;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::_Exit(0);
}
